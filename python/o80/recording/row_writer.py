"""Converts the rows of one run of a backend to messages."""

import time

import numpy as np
from numpy.typing import NDArray

from o80.base.machine import this_machine
from o80.frontend.reader import Reader
from o80.recording.blocks import Block
from o80.recording.epoch import DESCRIPTION, EpochNote, topic_of
from o80.recording.file_writer import FileWriter
from o80.recording.joint_states import JointWriter
from o80.recording.message_plan import MessagePlan
from o80.recording.message_types import PACKAGE, row_type


class RowWriter:
    """Converts the rows of one epoch to messages."""

    def __init__(
        self,
        file: FileWriter,
        frontend: Reader,
        note: EpochNote,
        channel: int | None = None,
        joints: int | None = None,
    ) -> None:
        """channel, joints: channels of the epoch in a file that is continued; what is missing, of
        message types, description and channels, is added.
        """
        layout = frontend._layout
        message = row_type(layout)
        if channel is None:
            schema = file.add_schema(f"{PACKAGE}/msg/{message.name}", message.definition)
            table = frontend._description.table()
            file.attach(note.record("description"), DESCRIPTION, table, time.time_ns())
            file.add_metadata(
                note.record("provenance"),
                {"json": frontend.provenance.as_json(), "machine": this_machine().as_json()},
            )
            channel = file.add_channel(topic_of(note.segment), schema, note.texts())
        self.note = note
        self.channel = channel
        self._joints = JointWriter.added_to(file, layout, note, joints)
        self._plan = MessagePlan(message)

    def blocks(self, rows: NDArray[np.void]) -> list[Block]:
        """Encodes consecutive rows; for a robot with joints, also as joint states."""
        raw = np.ascontiguousarray(rows).view(np.uint8).reshape(len(rows), -1)
        log_times = (rows["time"] + self.note.wall_offset).astype(np.uint64)
        first = int(rows["iteration"][0])
        block, messages = Block.reserved(self.channel, log_times, first, self._plan.size)
        self._plan.encode(raw, messages)
        return [block] if self._joints is None else [block, self._joints.block(raw, log_times)]
