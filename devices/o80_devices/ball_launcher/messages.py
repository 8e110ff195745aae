"""The messages of the launcher: protobuf (proto2), described at run time instead of by protoc.

    message Request { required RequestType request = 1; optional State state = 2; }
    enum RequestType { SET_STATE = 0; LAUNCH_BALL = 1; SET_RPM = 2; }
    message State { optional float phi = 1 [default = 0.5], theta = 2 [default = 0.5],
                    top_left_motor = 3, top_right_motor = 4, bottom_motor = 5; }

The reply is one byte: 1 done, 0 failed.
"""

from __future__ import annotations

from dataclasses import asdict, astuple, dataclass
from enum import IntEnum
from functools import cache
from typing import Any

import numpy as np

from o80.base.extras import needed

NAMES = ("phi", "theta", "top_left_motor", "top_right_motor", "bottom_motor")
DONE = (b"1", b"\x01")
REFUSED = (b"0", b"\x00")


class Kind(IntEnum):
    """Kind of a request."""

    SET_STATE = 0
    LAUNCH_BALL = 1
    SET_RPM = 2


@dataclass(frozen=True)
class State:
    """Angles and motors, each in [0, 1]; for SET_RPM the motors are in revolutions a minute."""

    phi: float = 0.5
    """Azimuth."""
    theta: float = 0.5
    """Altitude."""
    top_left_motor: float = 0.0
    top_right_motor: float = 0.0
    bottom_motor: float = 0.0

    def rounded(self) -> State:
        """Rounds all numbers to 32-bit floats, as the protocol does."""
        return State(*(float(np.float32(value)) for value in astuple(self)))


@dataclass(frozen=True)
class Request:
    """A message to the launcher."""

    kind: Kind
    state: State | None = None

    def encoded(self) -> bytes:
        """Encodes the message."""
        message = _request()()
        message.request = int(self.kind)
        if self.state is not None:
            for name, value in zip(NAMES, astuple(self.state), strict=True):
                setattr(message.state, name, value)
        encoded: bytes = message.SerializeToString()
        return encoded

    @classmethod
    def decoded(cls, content: bytes) -> Request:
        """Decodes a message. Raises ValueError if the bytes are no message."""
        from google.protobuf.message import DecodeError

        message = _request()()
        try:
            message.ParseFromString(content)
        except DecodeError as error:
            raise ValueError(f"not a request to a launcher: {error}") from None
        if not message.IsInitialized():
            raise ValueError("not a request to a launcher: it has no field `request`")
        state = None
        if message.HasField("state"):
            state = State(*(getattr(message.state, name) for name in NAMES))
        return cls(Kind(message.request), state)


@cache
def _request() -> Any:
    """Class of the message `Request`."""
    descriptor_pb2, descriptor_pool, message_factory = (
        needed(f"google.protobuf.{name}", "zeromq", "the ball launcher", package="o80-devices")
        for name in ("descriptor_pb2", "descriptor_pool", "message_factory")
    )
    file = descriptor_pb2.FileDescriptorProto(
        name="o80_ball_launcher.proto", package="o80_ball_launcher", syntax="proto2"
    )
    kinds = file.enum_type.add(name="RequestType")
    for kind in Kind:
        kinds.value.add(name=kind.name, number=kind.value)
    field = descriptor_pb2.FieldDescriptorProto
    state = file.message_type.add(name="State")
    for number, (name, default) in enumerate(asdict(State()).items(), start=1):
        state.field.add(
            name=name,
            number=number,
            type=field.TYPE_FLOAT,
            label=field.LABEL_OPTIONAL,
            default_value=str(default),
        )
    request = file.message_type.add(name="Request")
    request.field.add(
        name="request",
        number=1,
        type=field.TYPE_ENUM,
        label=field.LABEL_REQUIRED,
        type_name=".o80_ball_launcher.RequestType",
    )
    request.field.add(
        name="state",
        number=2,
        type=field.TYPE_MESSAGE,
        label=field.LABEL_OPTIONAL,
        type_name=".o80_ball_launcher.State",
    )
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("o80_ball_launcher.Request"))
