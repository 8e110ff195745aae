"""Finds where a replay can begin: row 0, a reset, the restore of a recorded snapshot, or a snapshot
that was taken while nothing acted.

Without a driver: at row 0, at a fresh start, or at a row in which nothing acts.
"""

import bisect
import itertools
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from o80.rows.layout import MASKS

if TYPE_CHECKING:
    import o80._core as _core
    from o80.replaying.recorded_run import RecordedRun


@dataclass(frozen=True)
class Start:
    """First row of a replay, with the state that the robot needs to continue from there."""

    row: int = 0
    entry: int = 0  #: number of the first entry of the journal to obey
    request: str = ""  #: "reset", "restore" or "fresh start"; empty at row 0 and at rest
    snapshots: dict[int, bytes] = field(default_factory=dict)  #: content by slot
    is_at_rest: bool = False  #: nothing acts in this row; with a driver, in the row before
    slot: int = 0  #: at rest, with a driver: slot of the snapshot
    before: bytes = b""  #: at rest, with a driver: the preceding row


def requests_in(
    entry: "_core.JournalEntry", schema: dict[str, Any]
) -> Iterator[tuple[str, int, int]]:
    """Yields name, slot and id of each request of a batch; slot -1: the request has none."""
    known = schema["requests"]
    for record in entry.records:
        if record.kind != "request":
            continue
        name = known[record.request]["name"] if record.request < len(known) else ""
        has_slot = name in ("snapshot", "restore") and len(record.payload) >= 4
        yield name, struct.unpack_from("<I", record.payload)[0] if has_slot else -1, record.id


class SlotsKept:
    """Tracks the slots whose snapshots the replay knows."""

    def __init__(self, schema: dict[str, Any], start: Start) -> None:
        self._schema, self._start = schema, start
        self._known = set(start.snapshots)

    def unknown(self, entry: "_core.JournalEntry") -> int | None:
        """Returns a slot that this batch restores although its snapshot is unknown, or None."""
        if entry.kind != "taken" or self._start.row == 0:
            return None
        for name, slot, _ in requests_in(entry, self._schema):
            if name == "snapshot":
                self._known.add(slot)
            elif name == "restore" and slot not in self._known:
                return slot
        return None


class Purges:
    """Finds purges before a start that end commands taken after the start.

    A purge also ends commands that were sent before it but are taken after it, for example because
    they were sent for a later iteration. A replay that begins between the two misses the purge.
    """

    def __init__(self, entries: "Iterator[_core.JournalEntry]") -> None:
        taken: list[tuple[int, int, bool]] = []  # number, ticket, whether it purges
        base = 0
        for entry in entries:
            if entry.kind == "order_lost":
                base += 1 << 64  # earlier purges no longer end commands
            elif entry.kind == "taken":
                purges = any(record.kind == "purge" for record in entry.records)
                taken.append((entry.number, base + entry.ticket, purges))
        self._numbers = [number for number, _, _ in taken]
        purged = (ticket if purges else -1 for _, ticket, purges in taken)
        self._newest_purge = [*itertools.accumulate(purged, max)]
        tickets = (ticket for _, ticket, _ in reversed(taken))
        self._oldest_behind = [*itertools.accumulate(tickets, min)][::-1]

    def reach_past(self, number: int) -> bool:
        """True if a purge before entry `number` ends a command that is taken from there on."""
        at = bisect.bisect_left(self._numbers, number)
        is_inside = 0 < at < len(self._numbers)
        return is_inside and self._newest_purge[at - 1] > self._oldest_behind[at]


def _fresh_starts(run: "RecordedRun") -> set[int]:
    """Returns the iterations of fresh starts without a halt."""
    return {
        int(row)
        for block in run.blocks()
        for row in block.iteration[(block.rows["fresh"] != 0) & (block.rows["halted"] == 0)]
    }


def find_start(run: "RecordedRun", since: int) -> Start | None:
    """Returns the first reset or restore at row `since` or later that can be a start, or None.

    A reset determines the whole state of a simulation, and so does a restored snapshot that the
    journal holds. Nothing else may be active: no halt, no request that takes time.
    """
    begun = _fresh_starts(run)
    purges = Purges(run.entries())
    snapshots: dict[int, bytes] = {}
    sent: set[tuple[int, int]] = set()  # lane and id of requests
    running: set[tuple[int, int]] = set()
    for entry in run.entries():
        if entry.kind == "snapshot":
            snapshots[entry.slot] = entry.kept
        elif entry.kind == "status":
            key = (entry.lane, entry.id)
            if entry.status != "active":
                running.discard(key)
                sent.discard(key)
            elif key in sent:
                running.add(key)
        elif entry.kind == "taken":
            named = list(requests_in(entry, run.schema))
            first = named[0] if named else ("", -1, 0)
            is_start = entry.iteration >= since and entry.iteration in begun and not running
            is_start = is_start and not purges.reach_past(entry.number)
            restores = [("restore", slot) for slot in snapshots]
            if is_start and (first[0] == "reset" or first[:2] in restores):
                return Start(entry.iteration, entry.number, first[0], snapshots)
            sent.update((entry.lane, number) for _, _, number in named)
    return None


def find_kept(run: "RecordedRun", since: int) -> Start | None:
    """Returns a start at the first snapshot from `since` on taken while nothing acted, or None.

    The snapshot is the state after the preceding row, which has the desired states that continue.
    """
    purges = Purges(run.entries())
    found: dict[int, tuple[int, int]] = {}  # by iteration: number of the first and the last entry
    ends: _core.JournalEntry | None = None  # the batch that ended a stretch in which nothing acts
    began: _core.JournalEntry | None = None
    for entry in run.entries():
        if entry.missed or entry.kind in _ACTS:
            began = ends = None
        if entry.kind == "at_rest":
            began = entry
        elif entry.kind == "taken" and (entry.records or entry.records_lost):
            if began is not None and began.iteration < entry.iteration:
                ends = entry
            began = None
            others = any(name != "snapshot" for name, _, _ in requests_in(entry, run.schema))
            if ends and (ends.iteration != entry.iteration or others or entry.records_lost):
                ends = None
        elif entry.kind == "snapshot" and ends is not None and ends.iteration == entry.iteration:
            reaches = purges.reach_past(ends.number)
            if entry.iteration >= since and not reaches:
                found[entry.iteration] = ends.number, entry.number
    for block in run.blocks():
        usual = (block.rows["fresh"] == 0) & (block.rows["halted"] == 0)
        for row in block.iteration[usual & np.isin(block.iteration + 1, [*found])]:
            before = block.select(since=int(row), until=int(row)).rows.tobytes()
            return _kept_at(run, int(row) + 1, found[int(row) + 1], before)
    return None


def _kept_at(run: "RecordedRun", row: int, numbers: tuple[int, int], before: bytes) -> Start:
    kept: dict[int, bytes] = {}
    for entry in run.entries():
        if entry.kind == "snapshot":
            kept[entry.slot] = entry.kept
        if entry.number == numbers[1]:
            break
    return Start(row, numbers[0], "", kept, is_at_rest=True, slot=entry.slot, before=before)


def find_fresh_start(run: "RecordedRun", since: int) -> Start | None:
    """Returns the first fresh start from `since` on, for a replay without a driver, or None.

    A fresh start drops all queues, and its row has the state of the robot. The batch that caused it
    must hold nothing else, because later records of the batch act after the fresh start.
    """
    begun = _fresh_starts(run)
    purges = Purges(run.entries())
    taken = (-1, -1, 0)  # iteration, lane and length of the last batch
    for entry in run.entries():
        if entry.kind == "taken":
            taken = (entry.iteration, entry.lane, len(entry.records))
        elif entry.kind == "fresh_start" and entry.iteration in begun and not entry.follows:
            is_alone = taken[:2] != (entry.iteration, entry.lane) or taken[2] == 1
            if is_alone and entry.iteration >= since and not purges.reach_past(entry.number):
                return Start(entry.iteration, entry.number, "fresh start")
    return None


def find_rest(run: "RecordedRun", since: int) -> Start | None:
    """Returns the first row from `since` on in which nothing acts, for a replay without a driver.

    The journal marks where such rows begin; they end before the next entry by which something acts.
    All masks of the row must be clear, as in a backend that begins.
    """
    purges = Purges(run.entries())
    ranges = [
        each
        for each in _rests(run.entries())
        if each[1] >= since and not purges.reach_past(each[2])
    ]
    for block in run.blocks():
        calm = (block.rows["fresh"] == 0) & (block.rows["halted"] == 0)
        calm &= block.iteration >= since
        for mask in MASKS:
            calm &= ~getattr(block, mask).any(axis=1)
        rows = block.iteration[calm]
        ranges = [each for each in ranges if len(block) == 0 or each[1] >= block.iteration[0]]
        for begin, end, number in ranges:
            if len(rows) == 0 or begin > rows[-1]:
                break
            found = rows[(rows >= begin) & (rows <= end)]
            if len(found):
                return Start(int(found[0]), number, is_at_rest=True)
    return None


_ACTS = {"halt", "resume", "died", "silent", "interrupted", "fresh_start", "stopping", "ended"}


def _rests(entries: "Iterator[_core.JournalEntry]") -> Iterator[tuple[int, int, int]]:
    """Yields first row, last row and number of the mark of each stretch in which nothing acts."""
    began: _core.JournalEntry | None = None
    newest = -1
    for entry in entries:
        acts = entry.kind in _ACTS or (
            entry.kind == "taken" and (len(entry.records) > 0 or entry.records_lost)
        )
        if began is not None and (acts or entry.missed):
            # something may have acted in the iteration of the last entry before the missing ones
            last = max(began.iteration, newest - 1) if entry.missed else entry.iteration - 1
            yield began.iteration, last, began.number
            began = None
        newest = max(newest, entry.iteration)
        if entry.kind == "at_rest":
            began = entry
    if began is not None:
        yield began.iteration, 2**62, began.number
