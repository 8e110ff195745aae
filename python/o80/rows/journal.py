"""The journal of a backend: its decisions, in order."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import o80._core as _core
from o80.base.cached import cached
from o80.base.words import CommandEnd, Reason, Status
from o80.rows.actuators import actuators_of
from o80.rows.enumerations import labelled
from o80.rows.layout import count_of, dtype_of_type, is_plain, labels_of_type, request_fields
from o80.rows.record import Record

ENDS = frozenset(Status) - {Status.NONE, Status.QUEUED, Status.ACTIVE, Status.FORGOTTEN}


@dataclass(frozen=True)
class JournalCommand:
    """A command, a request or an order of a batch, in the form in which its frontend sent it."""

    #: command, purge, request, take_control, release_control, resume, mark, close_plan or unknown
    kind: str
    id: int  #: the id in its `status` entries
    actuators: tuple[str, ...] = ()  #: of a command or a purge; empty for a purge of all
    #: For each actuator its target: a number, or a dictionary of the fields that were given. For a
    #: trajectory arrays, with a row for each waypoint.
    targets: tuple[Any, ...] = ()
    pace: str = ""  #: direct, duration, speed, until, iterations, fastest or chunk
    amount: float | None = None  #: duration [s], iterations, iteration of until, or speed
    mode: str = ""
    profile: str = ""
    start: str = ""
    times: tuple[float, ...] = ()  #: of a trajectory with its own times [s]
    #: Of a chunk: the iteration of the observation that it is based on, when each row is due if the
    #: actuators do not stand still, the iterations of its take-over (None: as many as its limits
    #: need), the first row that is played.
    anchor: int | None = None
    due: tuple[int, ...] = ()
    ease: int | None = None
    first: int | None = None
    fixed: bool = False  #: its rows keep their iterations also where the actuators stand still
    final: bool = False  #: no chunk of its plan follows
    only_own: bool = False  #: of a purge: only commands of its frontend
    request: str = ""  #: the name of the request
    fields: dict[str, Any] | None = None  #: values of the request's fields
    halt: int | None = None  #: of a resume
    text: str = ""  #: of a mark
    unknown: str = ""  #: of kind unknown: what a newer o80 has recorded, such as "record kind 10"


@dataclass(frozen=True)
class JournalEntry:
    """One decision of a backend. Fields that its kind does not have are None or empty."""

    number: int
    #: taken, scheduled, rejected, status, halt, halt_reason, resume, control_taken,
    #: control_released, control_lost, burst, burst_ended, died, silent, interrupted, fresh_start,
    #: order_lost, stopping, ended, snapshot or chunk_begun
    kind: str
    iteration: int
    missed: int = 0  #: entries before this one that were overwritten before they were read
    lane: int | None = None  #: the lane of the frontend that caused it
    sender: str = ""  #: process of this frontend, or of the halt; empty if unknown
    id: int | None = None  #: of the batch; of `status` and chunk_begun: of the command
    ticket: int | None = None  #: place of a batch in the order of all pulses
    at: int | None = None  #: iteration that a batch was sent for, if it is another one
    burst: int | None = None  #: iterations that a burst may run; -1 until its batch has ended
    seen: _core.Seen | None = None  #: row on which a batch is based, as reported by its sender
    cut: bool = False  #: of burst_ended: the burst ended early
    follows: bool = False  #: of fresh_start: idle actuators follow from there on
    commands: tuple[JournalCommand, ...] = ()
    commands_lost: bool = False  #: the commands were overwritten before they were read
    clipped: int = 0  #: numbers of its targets that `clip` has moved inside their bounds
    #: Of chunk_begun: the row that is reached first, the iterations by which its rows are later
    #: than sent for, and for each number ("elbow", "elbow.position") place, slope [1/iteration]
    #: and curvature in the previous iteration. These and the rows define the plan.
    row: int | None = None
    shift: int | None = None
    starts: dict[str, tuple[float, float, float]] | None = None
    status: Status | None = None
    reason: Reason | None = None
    halt: int | None = None  #: number of a halt
    cause: str = ""  #: of a halt
    text: str = ""  #: the reason of a halt, or of the end of the backend
    actuator: str = ""  #: actuator that the driver interrupted
    slot: int | None = None  #: slot in which the driver keeps a snapshot
    #: Parts of the entry or its commands that this o80 does not know, such as "entry kind 30" (the
    #: kind is "none" then): a newer one has recorded it.
    unknown: str = ""


def marks_in(entries: Iterable[JournalEntry]) -> list[tuple[str, int]]:
    """Returns text and iteration of the marks that were taken."""
    return [
        (command.text, entry.iteration)
        for entry in entries
        if entry.kind == "taken"
        for command in entry.commands
        if command.kind == "mark"
    ]


class Decisions(NamedTuple):
    """The N taken batches with a `seen` row, oldest first."""

    taken: NDArray[np.int64]  #: (N,) iteration in which the batch was taken
    epoch: NDArray[np.uint64]  #: (N,) the run that published the row
    iteration: NDArray[np.int64]  #: (N,) iteration of the row
    since: NDArray[np.int64]  #: (N,) iteration of the commanded robot then; -1: not known

    @property
    def latency(self) -> NDArray[np.int64]:
        """(M,) the known decision latencies [iterations]."""
        latency: NDArray[np.int64] = (self.taken - self.since)[self.since >= 0]
        return latency


def decisions(entries: Iterable[JournalEntry | _core.JournalEntry]) -> Decisions:
    """Relates batches to the rows on which they are based."""
    found = [
        (each.iteration, seen.epoch, seen.iteration, -1 if seen.since is None else seen.since)
        for each in entries
        if (seen := each.seen) is not None and each.kind == "taken"
    ]
    taken, epoch, iteration, since = zip(*found, strict=True) if found else ((), (), (), ())
    return Decisions(
        np.array(taken, np.int64),
        np.array(epoch, np.uint64),
        np.array(iteration, np.int64),
        np.array(since, np.int64),
    )


def latencies_of(entries: Iterable[JournalEntry | _core.JournalEntry]) -> list[int]:
    """Returns the decision latency of each batch with a `seen` row [iterations]; -1: not known."""
    taken = decisions(entries)
    latencies: list[int] = np.where(taken.since < 0, -1, taken.taken - taken.since).tolist()
    return latencies


def command_ends(entries: Iterable[JournalEntry]) -> list[CommandEnd]:
    """Returns the ends of all commands whose batch is among the entries, in order."""
    actuators: dict[tuple[int | None, int], tuple[str, ...]] = {}
    ends = []
    for entry in entries:
        commands = [each for each in entry.commands if each.kind == "command"]
        at, reason = entry.iteration, entry.reason or Reason.NONE
        if entry.kind == "rejected":
            ends += [CommandEnd(at, Status.REJECTED, each.actuators, reason) for each in commands]
            continue
        actuators.update({(entry.lane, each.id): each.actuators for each in commands})
        if entry.kind == "status" and entry.status in ENDS and entry.id is not None:
            named = actuators.pop((entry.lane, entry.id), None)
            if named is not None:
                ends.append(CommandEnd(at, entry.status, named, reason))
    return ends


_OF_ONE = ("status", "burst", "burst_ended", "chunk_begun")


class EntryDecoder:
    """Converts native entries with the schema of a robot."""

    def __init__(self, schema: dict[str, Any]) -> None:
        self._schema = schema
        self._names = [actuator["name"] for actuator in schema["actuators"]]
        self._types = [
            schema["groups"][actuator["group"]]["type"] for actuator in schema["actuators"]
        ]

    def entry(self, native: _core.JournalEntry) -> JournalEntry:
        kind = native.kind
        of_batch = kind in ("taken", "scheduled", "rejected")
        of_lane = native.lane < 2**32 - 1
        has_status = kind in ("status", "rejected")
        return JournalEntry(
            number=native.number,
            kind=kind,
            iteration=native.iteration,
            missed=native.missed,
            lane=native.lane if of_lane else None,
            sender=native.who,
            id=native.id if of_batch or kind in _OF_ONE else None,
            ticket=native.ticket if of_batch else None,
            at=native.at if of_batch and native.at not in (-1, native.iteration) else None,
            burst=native.burst if native.burst != 0 else None,
            seen=native.seen,
            cut=native.cut,
            follows=native.follows,
            commands=tuple(self.command(record) for record in native.records),
            commands_lost=native.records_lost,
            clipped=native.clipped,
            row=native.row if kind == "chunk_begun" else None,
            shift=native.shift if kind == "chunk_begun" else None,
            starts=self._starts(native) if kind == "chunk_begun" else None,
            status=native.status if has_status else None,
            reason=native.reason if has_status else None,
            halt=native.halt or None,
            cause=native.cause if kind in ("halt", "halt_reason") else "",
            text=native.text,
            actuator=self._name(native.actuator) if kind == "interrupted" else "",
            slot=native.slot if kind == "snapshot" else None,
            unknown=native.unknown,
        )

    def _starts(self, native: _core.JournalEntry) -> dict[str, tuple[float, float, float]]:
        return {self._paths[i][number]: start for i, number, start in native.starts}

    @cached
    def _paths(self) -> list[list[str]]:
        return [each.paths for each in actuators_of(self._schema)]

    def _name(self, index: int) -> str:
        name: str = self._names[index] if index < len(self._names) else str(index)
        return name or str(index)

    def command(self, native: _core.JournalRecord) -> JournalCommand:
        kind = native.kind
        if kind == "command":
            is_chunk = native.pace == "chunk"
            return JournalCommand(
                kind=kind,
                id=native.id,
                actuators=tuple(self._name(target.actuator) for target in native.targets),
                targets=tuple(self._target(target, native.rows) for target in native.targets),
                pace=native.pace,
                amount=_amount(native),
                mode=native.mode,
                profile=native.profile,
                start=native.start,
                times=tuple(time * 1e-9 for time in native.row_times),
                anchor=native.anchor if is_chunk else None,
                due=tuple(native.anchor + due for due in native.due),
                ease=native.ease or None if is_chunk else None,
                first=native.first if is_chunk else None,
                fixed=native.fixed,
                final=native.final,
            )
        if kind == "purge":
            every = native.actuator >= len(self._names)
            names = () if every else (self._name(native.actuator),)
            return JournalCommand(kind, native.id, names, only_own=native.only_own)
        if kind == "request":
            described = self._schema["requests"][native.request]
            record = request_fields(described["type"], native.payload)
            fields = {name: _plain(record[name]) for name in record}
            return JournalCommand(kind, native.id, request=described["name"], fields=fields)
        return JournalCommand(
            kind, native.id, halt=native.halt or None, text=native.text, unknown=native.unknown
        )

    def _target(self, native: _core.JournalTarget, rows: int) -> Any:
        """Returns the rows of one actuator; for a struct the given fields."""
        described = self._types[native.actuator]
        kind = dtype_of_type(described)
        states = np.frombuffer(native.states, kind, rows)
        known = labelled(states, labels_of_type(described))
        whole = known if rows > 1 else known[0]
        if is_plain(described):
            return whole.item() if isinstance(whole, np.generic) else whole
        given = iter(_bits(native.mask)) if native.mask else None
        fields: dict[str, Any] = {}
        for field in described["fields"]:
            bits = [given is None or next(given) for _ in range(count_of(kind[field["name"]]))]
            if any(bits):
                value = whole[field["name"]]
                fields[field["name"]] = value.item() if isinstance(value, np.generic) else value
        return fields


def _plain(value: Any) -> Any:
    """Converts a value of a record to plain Python; an enumerated value keeps its label."""
    value = np.asarray(value) if isinstance(value, Record) else value
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value


def _amount(native: _core.JournalRecord) -> float | None:
    if native.pace == "speed":
        return native.per_second
    if native.pace == "duration":
        return native.amount * 1e-9 if not native.row_times else None
    return native.amount if native.pace in ("until", "iterations") else None


def _bits(words: list[int]) -> Iterator[bool]:
    for word in words:
        yield from ((word >> bit) & 1 == 1 for bit in range(64))
