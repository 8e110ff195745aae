"""Rows of robots with joints as sensor_msgs/JointState, which every ROS tool shows.

A robot has joints if its rows hold positions by these rules, in this order:
- an actuator whose observed state has a number `position` is a joint; so is one whose state is a
  plain number with the unit rad or m;
- else each element of an array of sensor values named `joint_positions` (or `positions`).
Velocities and efforts come from the same place: numbers `velocity` and `effort` (or `torque`) of
the state, arrays of sensor values with one number for each joint.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from o80.recording.blocks import Block, stamps_of
from o80.recording.cdr import CdrWriter
from o80.recording.epoch import EpochNote, topic_of
from o80.recording.file_writer import JOINT_STATES, FileWriter
from o80.recording.message_types import HEADER
from o80.rows.columns import Column, columns_of
from o80.rows.layout import Layout

TYPE = "sensor_msgs/msg/JointState"
DEFINITION = f"""\
std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
{HEADER}"""
QUANTITIES = {
    "position": ("position",),
    "velocity": ("velocity",),
    "effort": ("effort", "torque"),
}
"""Names of the fields of a state, for each member of the message."""


@dataclass(frozen=True)
class Joints:
    """Where the rows of a robot hold positions, velocities and efforts of its joints."""

    names: tuple[str, ...]
    numbers: dict[str, tuple[Column, ...]]  #: by member of the message; empty: not in the rows


def joints_of(layout: Layout) -> Joints | None:
    """Finds the joints of a robot; None if the robot has none."""
    columns = {each.name: each for each in columns_of(layout.schema) if each.dtype.kind == "f"}
    names, found = [], []
    for i, actuator in enumerate(layout.schema["actuators"]):
        numbers = dict(_numbers_of(columns, f"observed.{actuator['name']}"))
        if "position" in numbers:
            names.append(actuator["name"] or f"joint_{i}")
            found.append(numbers)
    of_all = {
        quantity: tuple(each[quantity] for each in found if quantity in each)
        for quantity in QUANTITIES
    }
    if not found:
        of_all["position"] = _sensor(columns, "position", None)
        names = [f"joint_{i}" for i in range(len(of_all["position"]))]
    for quantity, numbers_of_all in of_all.items():
        if len(numbers_of_all) < len(names):
            of_all[quantity] = _sensor(columns, quantity, len(names))
    return Joints(tuple(names), of_all) if names else None


def _numbers_of(columns: Mapping[str, Column], path: str) -> Iterator[tuple[str, Column]]:
    """Yields quantity and place of the numbers of one state."""
    if path in columns and columns[path].unit in ("rad", "m"):
        yield "position", columns[path]
    for quantity, names in QUANTITIES.items():
        for name in reversed(names):  # the first one counts
            if (field := f"{path}.{name}") in columns:
                yield quantity, columns[field]


def _sensor(columns: Mapping[str, Column], quantity: str, length: int | None) -> tuple[Column, ...]:
    """Finds an array of sensor values for a quantity, with this length; empty if there is none."""
    plural = {"position": "positions", "velocity": "velocities"}
    wanted = set()
    for name in QUANTITIES[quantity]:
        several = plural.get(name, f"{name}s")
        wanted |= {f"joint_{several}", several}
        if length is not None:
            wanted.add(name)
    arrays: dict[str, list[Column]] = {}
    for path, column in columns.items():
        part, _, name = path.partition(".")
        field, _, place = name.partition("[")
        if part == "extended" and field in wanted and place[:-1].isdecimal():
            arrays.setdefault(field, []).append(column)
    fitting = (each for each in arrays.values() if length in (None, len(each)))
    return tuple(next(fitting, ()))


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
            texts = note.channel_texts(JOINT_STATES)
            channel = file.add_channel(topic_of(note.segment, JOINT_STATES), schema, texts)
        return cls(joints, channel)

    def __init__(self, joints: Joints, channel: int) -> None:
        self.channel = channel
        cdr = CdrWriter()
        self._stamp = cdr.stamp(0)
        cdr.text("")
        cdr.texts(joints.names)
        self._values: list[tuple[int, tuple[Column, ...]]] = []
        for numbers in joints.numbers.values():
            cdr.numbers("I", len(numbers))
            if numbers:
                self._values.append((cdr.numbers("d", *[0.0] * len(numbers)), numbers))
        self._template = cdr.data

    def block(self, raw: NDArray[np.uint8], log_times: NDArray[np.uint64]) -> Block:
        """Converts rows (n, bytes of a row) to messages."""
        first = int(raw[0, :8].view("<i8")[0])  # iteration
        block, messages = Block.reserved(self.channel, log_times, first, len(self._template))
        messages[:] = np.frombuffer(self._template, np.uint8)
        messages[:, self._stamp : self._stamp + 8] = stamps_of(log_times)
        for place, numbers in self._values:
            values = np.empty((len(raw), len(numbers)), "<f8")
            for i, each in enumerate(numbers):
                part = raw[:, each.offset : each.offset + each.dtype.itemsize]
                values[:, i] = part.view(each.dtype)[:, 0]
            messages[:, place : place + values.shape[1] * 8] = values.view(np.uint8)
        return block
