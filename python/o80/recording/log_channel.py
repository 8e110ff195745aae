"""The log of a recording: events of its robots as texts.

Messages are `rcl_interfaces/Log` on `/rosout`, which Foxglove, rqt and other tools show without
settings. The journal of the recording holds the same events exactly.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import o80._core as _core
from o80.base.errors import Error
from o80.base.words import Status
from o80.frontend.frontend import Frontend
from o80.recording.blocks import Block
from o80.recording.cdr import CdrWriter
from o80.recording.file_writer import FileWriter
from o80.recording.journal_channel import Entries
from o80.recording.message_types import TIME
from o80.rows.journal import ENDS, EntryDecoder, JournalEntry
from o80.rows.journal_text import JournalText, command_text, status_text

TOPIC = "/rosout"
TYPE = "rcl_interfaces/msg/Log"
DEBUG, INFO, WARN, ERROR = 10, 20, 30, 40
DEFINITION = f"""\
byte DEBUG=10
byte INFO=20
byte WARN=30
byte ERROR=40
byte FATAL=50
builtin_interfaces/Time stamp
uint8 level
string name
string msg
string file
string function
uint32 line
{TIME}"""
MAX_BYTES = 1 << 16  # of a journal per poll; beyond this, only notable entries get lines
MAX_ENDS = 20  # ends of commands with a line of their own per poll
_BATCHES = {"taken", "scheduled"}
_SILENT = {*_BATCHES, "burst", "burst_ended"}
_LEVELS = {
    "halt": ERROR,
    "halt_reason": ERROR,
    "order_lost": ERROR,
    "rejected": WARN,
    "died": WARN,
    "silent": WARN,
    "control_lost": WARN,
    "interrupted": WARN,
    "snapshot": DEBUG,
}
_LEVELS_OF_ENDS = {Status.INTERRUPTED: WARN, Status.REJECTED: WARN, Status.HALTED: WARN}


@dataclass(frozen=True)
class Line:
    """A line of the log."""

    segment: str
    time: int  #: log time [ns]
    level: int
    text: str

    def message(self) -> bytes:
        """Encodes the line as a CDR message."""
        cdr = CdrWriter()
        cdr.stamp(self.time)
        cdr.numbers("B", self.level)
        for text in (self.segment, self.text, "", ""):
            cdr.text(text)
        cdr.numbers("I", 0)
        return bytes(cdr.data)


def added_lines(file: FileWriter, lines: Sequence[Line]) -> Block:
    """Makes messages of lines (at least one) and adds the channel if needed."""
    channel = file.add_topic(TOPIC, TYPE, DEFINITION)
    return Block.of(channel, [(each.time, each.message()) for each in lines])


class JournalLog:
    """Makes log lines from journal entries while they are recorded."""

    def __init__(self, frontend: Frontend) -> None:
        self._description = frontend._description
        self._native = _core.RecordedJournal(self._description, 0)
        self._decoder = EntryDecoder(frontend.schema)
        self._open: dict[tuple[int, int], _core.JournalRecord] = {}  # open commands, by lane and id

    def lines(self, entries: Entries, notable: bool) -> list[tuple[int, int, str]]:
        """Returns iteration, level and text of each line.

        notable: the entries hold more than batches, bursts and ends of commands.
        """
        many = len(entries.content) > MAX_BYTES
        if many:  # the table of open commands would only grow
            self._native = _core.RecordedJournal(self._description, 0)
            self._open = {}
        if many and not notable:
            return []
        try:
            return self._lines(entries, many)
        except (Error, LookupError, ValueError) as error:  # a newer o80 wrote it, or it is damaged
            return [(-1, WARN, f"decisions that cannot be shown as text: {error}")]

    def _lines(self, entries: Entries, many: bool) -> list[tuple[int, int, str]]:
        natives = self._native.decode(entries.content, entries.codec)
        if many:
            natives = [each for each in natives if each.kind not in {*_SILENT, "status"}]
        ends = [each for each in natives if each.kind == "status" and each.status in ENDS]
        lines: list[tuple[int, int, str]] = []
        for native in natives:
            if native.kind in _BATCHES:
                self._open.update({(native.lane, each.id): each for each in native.records})
            elif native.kind == "status":
                if native.status in ENDS:
                    record = self._open.pop((native.lane, native.id), None)
                    if len(ends) <= MAX_ENDS:
                        lines.append(self._end(native, record))
            elif native.kind not in _SILENT:
                entry = self._decoder.entry(native)
                lines.append((entry.iteration, _level(entry), JournalText().text(entry)))
        if len(ends) > MAX_ENDS:
            counts = Counter(each.status for each in ends)
            text = ", ".join(f"{count} {status}" for status, count in counts.items())
            lines.append((ends[-1].iteration, INFO, f"commands ended: {text}"))
        return sorted(lines, key=lambda line: line[0])

    def _end(
        self, native: _core.JournalEntry, record: _core.JournalRecord | None
    ) -> tuple[int, int, str]:
        entry = self._decoder.entry(native)
        command = None if record is None else command_text(self._decoder.command(record))
        level = _LEVELS_OF_ENDS.get(native.status, INFO)
        return entry.iteration, level, status_text(entry, command)


def _level(entry: JournalEntry) -> int:
    if entry.kind == "ended":
        return ERROR if entry.text else INFO
    return _LEVELS.get(entry.kind, INFO)
