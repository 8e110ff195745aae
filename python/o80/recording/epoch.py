"""One run of a backend in a recording: metadata of its channel, its gaps, its clock."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from datetime import datetime
from typing import Any, NamedTuple

from o80.base.errors import RecordingError
from o80.frontend.reader import Reader
from o80.frontend.segments import boot_of
from o80.recording.cdr import ENCAPSULATION
from o80.recording.scan import Scan

DESCRIPTION = "application/x-o80-description"
"""Media type of the attachment with a robot's description, in the format of a segment."""
GAP = "o80.gap"
"""Name of the metadata records of missing rows, for example rows that were overwritten."""
LATE = "recording began later"
EARLIER_FILE = "the file before is missing"
OVERWRITTEN = "overwritten before the recorder read them"

# as src/memory/segment/segment_name.cpp allows
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,63}")


class Gap(NamedTuple):
    """Rows of a run that a recording lacks."""

    first: int  #: iteration
    last: int | None  #: iteration; None: the unknown last one of the run
    reason: str

    def __str__(self) -> str:
        if self.last is None:
            return f"rows from {self.first} on are missing: {self.reason}"
        if self.first == self.last:
            return f"row {self.first} is missing: {self.reason}"
        return f"rows {self.first} to {self.last} are missing: {self.reason}"


class Interruption(NamedTuple):
    """Time before a run in which this segment was not recorded: runs may be missing."""

    since: int  #: log time of the row before it [ns]
    until: int  #: log time of the first row of the run [ns]

    def __str__(self) -> str:
        begin, end = (datetime.fromtimestamp(each * 1e-9) for each in self)
        return (
            f"runs before this one may be missing: nothing was recorded from "
            f"{begin:%Y-%m-%d %H:%M:%S} to {end:%Y-%m-%d %H:%M:%S}"
        )


@dataclass(frozen=True)
class EpochNote:
    """Metadata of a channel of rows."""

    segment: str
    robot: str
    epoch: int
    number: int  #: index of this run among the runs of the segment in the file
    begin: int  #: iteration of the first row to record
    wall_offset: int  #: log time less row time [ns]
    clock: str  #: monotonic or simulated
    before: str = LATE  #: why rows before `begin` may be missing
    boot: str = ""  #: id of the boot to whose monotonic clock row times refer; empty: unknown

    def texts(self) -> dict[str, str]:
        return {name: str(value) for name, value in vars(self).items()}

    @classmethod
    def of(cls, texts: Mapping[str, str]) -> "EpochNote | None":
        """Parses the metadata of a channel; None if the channel holds no rows.

        Raises RecordingError for a name that no segment can have: it could lead to other folders.
        """
        name = texts.get("segment", "x")
        if not _NAME.fullmatch(name):
            raise RecordingError(
                f"the recording is damaged: {name[:80]!r} cannot be the name of a segment"
            )
        kinds: dict[str, Any] = {each.name: each.type for each in fields(cls) if each.name in texts}
        try:
            return cls(**{name: kind(texts[name]) for name, kind in kinds.items()})
        except (TypeError, ValueError):
            return None

    def run_texts(self) -> dict[str, str]:
        """Metadata that identify this run."""
        return {"segment": self.segment, "epoch": str(self.epoch), "number": str(self.number)}

    def channel_texts(self, content: str) -> dict[str, str]:
        """Returns metadata for a channel of this run that holds other content than rows."""
        return {"content": content} | self.run_texts()

    def record(self, what: str) -> str:
        """Returns the name of a record of this run: description, provenance, end, interruption."""
        return f"{self.segment}/{self.number}/{what}"


@dataclass
class WallClock:
    """Places robots on one wall clock.

    Rows of one boot keep their exact distances, even if the wall clock was set between starts.
    """

    offsets: dict[str, int]  #: log time less row time, by boot [ns]
    after: int = 0  #: log time that rows of a new boot must follow [ns]

    def placed(self, note: EpochNote, first_time: int, last_log_time: int) -> EpochNote:
        """Returns the note with its boot's offset; `first_time` is placed after `last_log_time`."""
        if note.boot in self.offsets:
            note = replace(note, wall_offset=self.offsets[note.boot])
        elif note.boot:
            last_log_time = max(last_log_time, self.after)
        offset = max(note.wall_offset, last_log_time + 1 - first_time)
        note = replace(note, wall_offset=offset)
        if note.boot:
            self.offsets.setdefault(note.boot, note.wall_offset)
        return note


def topic_of(segment: str, content: str = "") -> str:
    """Returns a topic that ROS 2 accepts, for a segment's rows or for other content.

    Characters other than letters and digits become single underscores; a name that begins with a
    digit gets `x_`. Two names may share a topic; the channel's metadata have the segment's name.
    """
    plain = re.sub(r"[^A-Za-z0-9]+", "_", segment).strip("_") or "x"
    name = f"x_{plain}" if plain[0].isdigit() else plain
    return f"/{name}/{content}" if content else f"/{name}"


def iteration_in(message: bytes) -> int:
    """Iteration of the row in a message: its first member."""
    begin = len(ENCAPSULATION)
    return int.from_bytes(message[begin : begin + 8], "little", signed=True)


def note_of(frontend: "Reader", number: int, begin: int) -> EpochNote:
    """Makes the note for the rows from `begin` on."""
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
    """Returns the channels with this content, by segment and number of the run."""
    return {
        (each.metadata["segment"], int(each.metadata["number"])): each.id
        for each in found.channels.values()
        if each.metadata.get("content") == content
        and each.metadata.get("number", "").isdecimal()
        and "segment" in each.metadata
    }
