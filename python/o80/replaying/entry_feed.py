"""Passes journal entries to a replay, just before the rows in which they act."""

from collections.abc import Iterator
from typing import Any

import o80._core as _core
from o80.replaying.start import SlotsKept, Start


class EntryFeed:
    """Reads a journal in step with the rows of its run."""

    def __init__(
        self,
        entries: Iterator[_core.JournalEntry],
        start: Start,
        slots: SlotsKept,
        rules: "MotionRules",
    ) -> None:
        self._entries = (entry for entry in entries if entry.number >= start.entry)
        self._begins = start.entry
        self._slots = slots
        self._rules = rules
        self._pending: _core.JournalEntry | None = None
        self._known = -1  # all decisions up to this iteration were read
        self.gap = ""  #: why the decisions after `until` are not known
        self.until = 2**62  #: the last iteration whose decisions are known

    def read(self, last: int) -> list[_core.JournalEntry]:
        """Returns the entries that act up to iteration `last`, without those of earlier calls."""
        found = []
        while not self.gap and (entry := self._next()) is not None:
            slot = self._slots.unknown(entry)
            if slot is not None:
                self.until = entry.iteration - 1
                self.gap = (
                    f"the snapshot in slot {slot}, which row {entry.iteration} restores, is not "
                    f"recorded"
                )
            elif self._lacks(entry) or entry.records_lost:
                self.until = self._known
                self.gap = f"the journal lacks the commands of entry {entry.number}"
                if entry.missed:
                    first = entry.number - entry.missed
                    self.gap = f"the journal lacks entries {first} to {entry.number - 1}"
            elif moved := self._rules.moved_otherwise(entry):
                self.until = entry.iteration - 1
                self.gap = (
                    f"row {entry.iteration} begins a command of {moved}, which motion rules "
                    f"{self._rules.now} may move otherwise"
                )
            elif entry.unknown and entry.kind != "scheduled":
                self.until = entry.iteration - 1
                self.gap = (
                    f"entry {entry.number} of the journal holds what this o80 does not know "
                    f"({entry.unknown}): replay it with the o80 that recorded it, or a newer one"
                )
            elif entry.kind == "ended" or entry.iteration > last:
                self._pending = entry
                break
            else:
                found.append(entry)
                # a status is written after the row of its iteration, a decision before
                self._known = max(self._known, entry.iteration - (entry.kind != "status"))
        return found

    def _lacks(self, entry: _core.JournalEntry) -> bool:
        """True if entries between the start of the replay and this entry are missing."""
        return entry.missed > 0 and (entry.number > self._begins or self._begins == 0)

    def _next(self) -> _core.JournalEntry | None:
        pending, self._pending = self._pending, None
        return pending if pending is not None else next(self._entries, None)


class MotionRules:
    """Versions of the motion rules of a recorded run and of this o80.

    If they differ, a command may move differently unless its motion is a straight line: where there
    is a speed limit (an acceleration limit needs one) or a value at rest, or with another profile.
    """

    now = _core.MOTION_RULES

    def __init__(self, schema: dict[str, Any], recorded: int) -> None:
        self.recorded = recorded
        self.differ = recorded != self.now
        self._actuators = schema["actuators"]

    def moved_otherwise(self, entry: _core.JournalEntry) -> str:
        """Returns the name of the first actuator that this entry may move differently, or ""."""
        if not self.differ or entry.kind != "taken":
            return ""
        for record in entry.records:
            for target in record.targets:
                actuator = self._actuators[target.actuator]
                limits = actuator["limits"]
                limited = any(each["speed"] is not None or "rest" in each for each in limits)
                if limited or record.profile != "linear":
                    return actuator["name"] or f"actuator {target.actuator}"
        return ""

    def __str__(self) -> str:
        return f"it moved by motion rules {self.recorded}, this o80 has motion rules {self.now}"
