"""Poses of a robot's bodies as tf2_msgs/TFMessage, which ROS tools and Foxglove show in 3D."""

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from o80.recording.blocks import Block, stamps_of
from o80.recording.cdr import CdrWriter
from o80.recording.file_writer import FileWriter
from o80.recording.message_plan import plan_of_rows
from o80.recording.message_types import HEADER, SEPARATOR
from o80.rows.layout import Layout

TOPIC = "/tf"
TYPE = "tf2_msgs/msg/TFMessage"
WORLD = "world"  #: frame of the models' world, to which all poses refer
DEFINITION = f"""\
geometry_msgs/TransformStamped[] transforms
{SEPARATOR}
MSG: geometry_msgs/TransformStamped
std_msgs/Header header
string child_frame_id
geometry_msgs/Transform transform
{HEADER}{SEPARATOR}
MSG: geometry_msgs/Transform
geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation
{SEPARATOR}
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
{SEPARATOR}
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
"""
_XYZ_THEN_XYZW = [0, 1, 2, 4, 5, 6, 3]  # MuJoCo begins a quaternion with w


class Poses(Protocol):
    """Moving bodies of a robot, and where their poses are in a row."""

    @property
    def bodies(self) -> Sequence[str]: ...

    def observed(self, row: bytes) -> NDArray[np.float64]:
        """Returns positions [m] and quaternions (w first) in the world: (bodies, 7)."""


class TransformWriter:
    """Writes one message in each period."""

    def __init__(
        self, file: FileWriter, segment: str, layout: Layout, poses: Poses, rate: float
    ) -> None:
        """rate: frequency of the messages [Hz]."""
        self._poses, self._rate = poses, rate
        self._layout = layout
        self._last = -1.0  # number of the period of the last message
        self._count = 0
        self._channel = file.add_topic(TOPIC, TYPE, DEFINITION)
        cdr = CdrWriter()
        cdr.numbers("I", len(poses.bodies))
        self._stamps, self._places = [], []
        for body in poses.bodies:
            self._stamps.append(cdr.stamp(0))
            cdr.text(WORLD)
            cdr.text(f"{segment}/{body}")
            self._places.append(cdr.numbers("d", *[0.0] * 7))
        self._template = cdr.data

    def block(self, rows: Sequence[tuple[int, bytes]]) -> Block | None:
        """Encodes the due ones of rows (log time [ns], message); None if no message is due."""
        chosen = []
        for time, message in rows:
            period = time * self._rate // 1_000_000_000
            if period > self._last:
                self._last = period
                chosen.append((time, message))
        if not chosen:
            return None
        log_times = np.array([time for time, _ in chosen], np.uint64)
        encoded = np.frombuffer(b"".join(message for _, message in chosen), np.uint8).reshape(
            len(chosen), -1
        )
        raw = plan_of_rows(self._layout, encoded.shape[1]).decode(encoded)
        block = Block.reserved(self._channel, log_times, self._count, len(self._template))
        self._count += len(chosen)
        messages: Any = block.messages
        messages[:] = np.frombuffer(self._template, np.uint8)
        for at in self._stamps:
            messages[:, at : at + 8] = stamps_of(log_times)
        for message, row in zip(messages, raw, strict=True):
            poses = self._poses.observed(row.tobytes())[:, _XYZ_THEN_XYZW]
            for at, pose in zip(self._places, poses, strict=True):
                message[at : at + 56] = np.frombuffer(pose.astype("<f8").tobytes(), np.uint8)
        return block
