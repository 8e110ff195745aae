"""Poses of a robot's bodies as tf2_msgs/TFMessage, which ROS tools and Foxglove show in 3D."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from o80.recording.blocks import Block, stamps_of
from o80.recording.cdr import CdrWriter
from o80.recording.file_writer import FileWriter
from o80.recording.message_plan import Bytes
from o80.recording.message_types import HEADER, SEPARATOR

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

    def __init__(self, file: FileWriter, segment: str, poses: Poses, rate: float) -> None:
        """rate: frequency of the messages [Hz]."""
        self._poses, self._rate = poses, rate
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

    def block(self, raw: Bytes, log_times: NDArray[np.uint64]) -> Block | None:
        """Encodes the due ones of rows (n, bytes of a row); None if no message is due."""
        periods = np.append(self._last, log_times * self._rate // 1_000_000_000)
        due = np.diff(np.maximum.accumulate(periods)) > 0
        if not due.any():
            return None
        raw, log_times, self._last = raw[due], log_times[due], periods.max()
        block, messages = Block.reserved(self._channel, log_times, self._count, len(self._template))
        self._count += len(raw)
        messages[:] = np.frombuffer(self._template, np.uint8)
        for at in self._stamps:
            messages[:, at : at + 8] = stamps_of(log_times)
        for message, row in zip(messages, raw, strict=True):
            poses = self._poses.observed(row.tobytes())[:, _XYZ_THEN_XYZW]
            for at, pose in zip(self._places, poses, strict=True):
                message[at : at + 56] = np.frombuffer(pose.astype("<f8").tobytes(), np.uint8)
        return block
