"""Rows of robots with joints as sensor_msgs/JointState, which every ROS tool shows.

A robot has joints if its rows hold positions by these rules, in this order:
- an actuator whose observed state has a number `position` is a joint; so is one whose state is a
  plain number with the unit rad or m;
- else each element of an array of sensor values named `joint_positions` (or `positions`).
Velocities and efforts come from the same place: numbers `velocity` and `effort` (or `torque`) of
the state, arrays of sensor values with one number for each joint.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.recording.blocks import Block, stamps_of
from o80.recording.cdr import ENCAPSULATION, CdrWriter
from o80.recording.epoch import EpochNote, topic_of
from o80.recording.file_writer import FileWriter
from o80.recording.message_types import HEADER
from o80.rows.layout import Layout, is_plain

TYPE = "sensor_msgs/msg/JointState"
DEFINITION = f"""\
std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
{HEADER}"""
CONTENT = "joint_states"  #: name of this content in the metadata of the channel
QUANTITIES = {
    "position": ("position",),
    "velocity": ("velocity",),
    "effort": ("effort", "torque"),
}
"""Names of the fields of a state, for each member of the message."""
FLOATS = ("float32", "float64")


@dataclass(frozen=True)
class Number:
    """A number of a row."""

    offset: int  #: [bytes]
    kind: str


@dataclass(frozen=True)
class Joints:
    """Where the rows of a robot hold positions, velocities and efforts of its joints."""

    names: tuple[str, ...]
    numbers: dict[str, tuple[Number, ...]]  #: by member of the message; empty: not in the rows


def joints_of(layout: Layout) -> Joints | None:
    """Finds the joints of a robot; None if the robot has none."""
    found = _actuators_that_are_joints(layout)
    if found:
        names = tuple(name for name, _ in found)
        numbers = {
            quantity: tuple(each[quantity] for _, each in found)
            if all(quantity in each for _, each in found)
            else ()
            for quantity in QUANTITIES
        }
    else:
        positions = _sensor(layout, "position", None)
        if not positions:
            return None
        names = tuple(f"joint_{i}" for i in range(len(positions)))
        numbers = {"position": positions, "velocity": (), "effort": ()}
    for quantity in QUANTITIES:
        numbers[quantity] = numbers[quantity] or _sensor(layout, quantity, len(names))
    return Joints(names, numbers)


def _actuators_that_are_joints(layout: Layout) -> list[tuple[str, dict[str, Number]]]:
    schema = layout.schema
    found = []
    for i, actuator in enumerate(schema["actuators"]):
        described = schema["groups"][actuator["group"]]["type"]
        numbers = dict(_numbers_of(described, schema["row"]["observed"] + actuator["offset"]))
        if "position" in numbers:
            found.append((actuator["name"] or f"joint_{i}", numbers))
    return found


def _numbers_of(described: dict[str, Any], offset: int) -> Iterator[tuple[str, Number]]:
    """Yields quantity and place of the numbers of one state."""
    for field in described["fields"]:
        if field["kind"] not in FLOATS or field["shape"]:
            continue
        number = Number(offset + field["offset"], field["kind"])
        if is_plain(described):
            if field["unit"] in ("rad", "m"):
                yield "position", number
            return
        for quantity, names in QUANTITIES.items():
            if field["name"] in names:
                yield quantity, number


def _sensor(layout: Layout, quantity: str, length: int | None) -> tuple[Number, ...]:
    """Finds an array of sensor values for a quantity, with this length; empty if there is none."""
    if "extended" not in layout.schema:
        return ()
    plural = {"position": "positions", "velocity": "velocities"}
    wanted = set()
    for name in QUANTITIES[quantity]:
        several = plural.get(name, f"{name}s")
        wanted |= {f"joint_{several}", several}
        if length is not None:
            wanted.add(name)
    begin = layout.schema["row"]["extended"]
    for field in layout.schema["extended"]["fields"]:
        if field["name"] not in wanted or field["kind"] not in FLOATS or len(field["shape"]) != 1:
            continue
        (count,) = field["shape"]
        if length is None or count == length:
            first, size = begin + field["offset"], field["size"]
            return tuple(Number(first + i * size, field["kind"]) for i in range(count))
    return ()


class JointWriter:
    """Converts rows to JointState messages, many at once: all have the same length."""

    @classmethod
    def added_to(
        cls, file: "FileWriter", layout: Layout, note: EpochNote, channel: int | None
    ) -> "JointWriter | None":
        """Adds a channel for joint states unless it exists; None if there is nothing to write."""
        joints = joints_of(layout) if file.form.joint_states else None
        if joints is None:
            return None
        if channel is None:
            schema = file.add_schema(TYPE, DEFINITION)
            texts = note.channel_texts(CONTENT)
            channel = file.add_channel(topic_of(note.segment, CONTENT), schema, texts)
        return cls(joints, channel)

    def __init__(self, joints: Joints, channel: int) -> None:
        self.channel = channel
        cdr = CdrWriter()
        self._stamp = cdr.stamp(0)
        cdr.text("")
        cdr.texts(joints.names)
        self._values: list[tuple[int, tuple[Number, ...]]] = []
        for numbers in joints.numbers.values():
            cdr.numbers("I", len(numbers))
            if numbers:
                self._values.append((cdr.numbers("d", *[0.0] * len(numbers)), numbers))
        self._template = cdr.data

    def block(self, raw: NDArray[np.uint8], log_times: NDArray[np.uint64], first: int) -> Block:
        """Converts rows (n, bytes of a row) to messages; first: iteration of the first row."""
        block = Block.reserved(self.channel, log_times, first, len(self._template))
        messages = block.messages
        messages[:] = np.frombuffer(self._template, np.uint8)
        messages[:, self._stamp : self._stamp + 8] = stamps_of(log_times)
        for place, numbers in self._values:
            values = np.empty((len(raw), len(numbers)), "<f8")
            for i, number in enumerate(numbers):
                values[:, i] = np.ndarray(
                    (len(raw),), number.kind, raw, number.offset, (raw.strides[0],)
                )
            messages[:, place : place + values.shape[1] * 8] = values.view(np.uint8)
        return block


def stamped(message: bytes, log_time: int) -> bytes:
    """Returns a message with another time [ns] in the header at its begin."""
    begin = len(ENCAPSULATION)
    return message[:begin] + struct.pack("<II", *divmod(log_time, 10**9)) + message[begin + 8 :]
