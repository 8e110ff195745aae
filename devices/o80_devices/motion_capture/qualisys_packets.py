"""Encodes and decodes packets of the Qualisys real-time protocol, little endian.

The vendor's client, qtm-rt 3.1, is not used: a packet of 0 bytes or with a damaged
number of components causes an endless loop, and the size of a packet is not limited.
"""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Mapping, Sequence
from enum import IntEnum

import numpy as np

from o80_devices.motion_capture.frame import Subject
from o80_devices.motion_capture.transform import quaternion_of

PORT = 22223  # port of the little-endian protocol
VERSION = "1.19"
GREETING = "QTM RT Interface connected"
MILLIMETRE = 1e-3  # [m]
LARGEST = 1 << 24  # largest size of a packet [bytes]

HEADER = struct.Struct("<II")  # size with the header, type
DATA = struct.Struct("<qII")  # time stamp [us], frame number, components
COMPONENT = struct.Struct("<II")  # size with its header, type
BODIES = struct.Struct("<Ihh")  # number, rates of dropped and out of sync frames
# position [mm], rotation, residual [mm]. The rotation comes column by column: public clients map
# it to a column-major matrix (qualisys_cpp_sdk's array of nine into an Eigen::Matrix3f)
BODY = struct.Struct("<3f9ff")
MAX_COMPONENTS = 64
MAX_BODIES = 1000
NOT_ORTHOGONAL = 1e-2  # tolerance of R R^T = 1
SIX_D_WITH_RESIDUAL = 11


class Type(IntEnum):
    ERROR = 0
    COMMAND = 1
    XML = 2
    DATA = 3
    NO_MORE_DATA = 4
    EVENT = 6


def packet(kind: Type, payload: bytes) -> bytes:
    return HEADER.pack(HEADER.size + len(payload), kind) + payload


def text(kind: Type, words: str) -> bytes:
    return packet(kind, words.encode() + b"\0")


def words_of(payload: bytes) -> str:
    return payload.rstrip(b"\0").decode(errors="replace")


class Packets:
    """Packets of a TCP connection. Raises OSError when closed, ValueError for invalid packets."""

    def __init__(self, connected: socket.socket) -> None:
        self._socket = connected
        self._buffer = b""

    def send(self, kind: Type, words: str) -> None:
        self._socket.sendall(text(kind, words))

    def receive(self, timeout: float) -> tuple[int, bytes] | None:
        """Returns type and content of the next packet; None after the timeout [s]."""
        end = time.monotonic() + timeout
        while (found := self._whole()) is None:
            self._socket.settimeout(max(1e-4, end - time.monotonic()))
            try:
                got = self._socket.recv(1 << 16)
            except TimeoutError:
                return None
            if not got:
                raise ConnectionError("the server has closed the connection")
            self._buffer += got
            if time.monotonic() > end:  # an incomplete packet counts as silence
                return self._whole()
        return found

    def close(self) -> None:
        self._socket.close()

    def _whole(self) -> tuple[int, bytes] | None:
        if len(self._buffer) < HEADER.size:
            return None
        size, kind = HEADER.unpack_from(self._buffer)
        if not HEADER.size <= size <= LARGEST:
            raise ValueError(f"a packet of {size} bytes: is this the little-endian port {PORT}?")
        if len(self._buffer) < size:
            return None
        content, self._buffer = self._buffer[HEADER.size : size], self._buffer[size:]
        return kind, content


def data_packet(stamp: int, number: int, components: Mapping[int, Sequence[bytes]]) -> bytes:
    """Builds a data packet. stamp: [us]. components: content of each type, such as BODY each."""
    parts = [DATA.pack(stamp, number, len(components))]
    for kind, each in components.items():
        content = BODIES.pack(len(each), 0, 0) + b"".join(each)
        parts += [COMPONENT.pack(COMPONENT.size + len(content), kind), content]
    return packet(Type.DATA, b"".join(parts))


def parsed_data(content: bytes) -> tuple[int, int, list[Subject]]:
    """Returns time stamp [us], frame number and bodies. Raises ValueError for a damaged packet."""
    try:
        stamp, number, components = DATA.unpack_from(content)
        if components > MAX_COMPONENTS:
            raise ValueError(f"a data packet of {components} components is damaged")
        place = DATA.size
        for _ in range(components):
            size, kind = COMPONENT.unpack_from(content, place)
            if kind == SIX_D_WITH_RESIDUAL:
                return stamp, number, _bodies(content, place + COMPONENT.size)
            place += max(size, COMPONENT.size)
    except struct.error as error:
        raise ValueError(f"a data packet is cut: {error}") from error
    return stamp, number, []


def _bodies(content: bytes, place: int) -> list[Subject]:
    count, _, _ = BODIES.unpack_from(content, place)
    if count > MAX_BODIES:
        raise ValueError(f"a frame of {count} bodies is damaged")
    place += BODIES.size
    bodies = []
    for _ in range(count):
        x, y, z, *numbers = BODY.unpack_from(content, place)
        place += BODY.size
        rotation = np.array(numbers[:9]).reshape(3, 3).T
        # the server sends NaN for an unseen body; an invalid rotation counts as unseen, too
        with np.errstate(invalid="ignore"):
            turns = np.abs(rotation @ rotation.T - np.eye(3)).max() < NOT_ORTHOGONAL
        if not (turns and np.isfinite([x, y, z]).all() and np.linalg.det(rotation) > 0):
            bodies.append(Subject(False))
            continue
        position = (x * MILLIMETRE, y * MILLIMETRE, z * MILLIMETRE)
        residual = numbers[9] * MILLIMETRE
        bodies.append(Subject(True, position, quaternion_of(rotation), residual))
    return bodies
