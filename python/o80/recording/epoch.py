"""One run of a backend in a recording: its channel, its description, its clock."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from typing import NamedTuple

from o80.base.errors import RecordingError
from o80.frontend.reader import Reader
from o80.frontend.segments import boot_of
from o80.recording.cdr import ENCAPSULATION
from o80.recording.scan import Scan

DESCRIPTION = "application/x-o80-description"
"""Media type of the attachment with the description of a robot, as it is in a segment."""
GAP = "o80.gap"
"""Name of the metadata record of rows that are missing, such as those that were overwritten."""
LATE = "recording began later"
EARLIER_FILE = "the file before is missing"
OVERWRITTEN = "overwritten before the recorder read them"

# as src/memory/segment/segment_name.cpp allows
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,63}")


class Gap(NamedTuple):
    """Rows of a run that a recording lacks."""

    first: int  #: iteration
    last: int | None  #: iteration; None: the last one of the run, which is not known
    reason: str

    def __str__(self) -> str:
        if self.last is None:
            return f"rows from {self.first} on are missing: {self.reason}"
        if self.first == self.last:
            return f"row {self.first} is missing: {self.reason}"
        return f"rows {self.first} to {self.last} are missing: {self.reason}"


class Interruption(NamedTuple):
    """Time before a run in which nothing of its segment was recorded: runs may be missing."""

    since: int  #: log time of the last row before [ns]
    until: int  #: of the first row of the run

    def __str__(self) -> str:
        begin, end = (datetime.fromtimestamp(each * 1e-9) for each in self)
        return (
            f"runs before this one may be missing: nothing was recorded from "
            f"{begin:%Y-%m-%d %H:%M:%S} to {end:%Y-%m-%d %H:%M:%S}"
        )


@dataclass(frozen=True)
class EpochNote:
    """Metadata of a channel about its rows."""

    segment: str
    robot: str
    epoch: int
    number: int  #: of this run among those of the segment in the file, from 0
    begin: int  #: iteration of the first row to record
    wall_offset: int  #: log time less row time [ns]
    clock: str  #: monotonic or simulated
    before: str = LATE  #: why rows before `begin` are missing, if they are
    boot: str = ""  #: of the machine whose monotonic clock the rows have; empty: not known

    def texts(self) -> dict[str, str]:
        return {name: str(value) for name, value in vars(self).items()}

    @classmethod
    def of(cls, texts: Mapping[str, str]) -> "EpochNote | None":
        """None for a channel that is not one of rows.

        Raises RecordingError for a name that no segment has: it could lead to other folders.
        """
        name = texts.get("segment", "x")
        if not _NAME.fullmatch(name):
            raise RecordingError(
                f"the recording is damaged: {name[:80]!r} cannot be the name of a segment"
            )
        try:
            return cls(
                segment=texts["segment"],
                robot=texts["robot"],
                epoch=int(texts["epoch"]),
                number=int(texts["number"]),
                begin=int(texts["begin"]),
                wall_offset=int(texts["wall_offset"]),
                clock=texts["clock"],
                before=texts.get("before", LATE),
                boot=texts.get("boot", ""),
            )
        except (KeyError, ValueError):
            return None

    def run_texts(self) -> dict[str, str]:
        """Texts that name this run."""
        return {"segment": self.segment, "epoch": str(self.epoch), "number": str(self.number)}

    def channel_texts(self, content: str) -> dict[str, str]:
        """The metadata of a channel of this run that holds something else than its rows."""
        return {"content": content} | self.run_texts()

    def record(self, what: str) -> str:
        """Name of a record of this run: its description (an attachment), its provenance, its end
        with the last row, or the interruption before it, in which nothing was recorded.
        """
        return f"{self.segment}/{self.number}/{what}"

    def not_before(self, first_time: int, log_time: int) -> "EpochNote":
        """The same; the log time of a row at `first_time` is later than `log_time`."""
        offset = max(self.wall_offset, log_time + 1 - first_time)
        return replace(self, wall_offset=offset)


@dataclass
class WallClock:
    """Wall-clock times of robots on monotonic clocks: those of one boot keep their distances,
    although the wall clock was read at the start of each, and may have been set in between.
    """

    offsets: dict[str, int]  #: log time less row time, by boot [ns]
    after: int = 0  #: before rows of another boot [ns]

    def placed(self, note: EpochNote, first_time: int, last_log_time: int) -> EpochNote:
        """The note with the offset of its boot; a row at `first_time` is after `last_log_time`."""
        if note.boot in self.offsets:
            note = replace(note, wall_offset=self.offsets[note.boot])
        elif note.boot:
            last_log_time = max(last_log_time, self.after)
        note = note.not_before(first_time, last_log_time)
        if note.boot:
            self.offsets.setdefault(note.boot, note.wall_offset)
        return note


def topic_of(segment: str, content: str = "") -> str:
    """Topic of a segment's rows, or of something else of it, as ROS 2 accepts it.

    All but letters and digits are single underscores between them; a name that begins with a digit
    gets `x_`. Two names may have one topic; the metadata of the channel have the name itself.
    """
    plain = re.sub(r"[^A-Za-z0-9]+", "_", segment).strip("_") or "x"
    name = f"x_{plain}" if plain[0].isdigit() else plain
    return f"/{name}/{content}" if content else f"/{name}"


def iteration_in(message: bytes) -> int:
    """Iteration of the row that a message holds, its first member."""
    begin = len(ENCAPSULATION)
    return int.from_bytes(message[begin : begin + 8], "little", signed=True)


def note_of(frontend: "Reader", number: int, begin: int) -> EpochNote:
    """Note about the rows from `begin` on."""
    return EpochNote(
        segment=frontend.segment,
        robot=frontend.robot,
        epoch=frontend.epoch,
        number=number,
        begin=begin,
        wall_offset=frontend.provenance.wall_clock_offset,
        clock=frontend.schema["clock"],
        boot=boot_of(frontend),
    )


def channels_of(found: "Scan", content: str) -> dict[tuple[str, int], int]:
    """The channels with this content, by segment and number of the run."""
    return {
        (each.metadata["segment"], int(each.metadata["number"])): each.id
        for each in found.channels.values()
        if each.metadata.get("content") == content
        and each.metadata.get("number", "").isdecimal()
        and "segment" in each.metadata
    }
