"""Effect on a replay of other rules of motion than those of this o80."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import o80._core as _core


@dataclass(frozen=True)
class MotionRules:
    """The rules of a recorded run and of this o80.

    Under other rules a command may move otherwise if its motion is not a straight line: where there
    is a limit of speed (one of acceleration needs it) or a value at rest, or with another profile.
    """

    recorded: int
    now: int
    names: tuple[str, ...]  #: of all actuators
    limited: frozenset[int]  #: the actuators with such limits

    @classmethod
    def of(cls, schema: dict[str, Any], recorded: int, now: int) -> MotionRules:
        actuators = list(enumerate(schema["actuators"]))
        limited = (
            number
            for number, actuator in actuators
            if any(each["speed"] is not None or "rest" in each for each in actuator["limits"])
        )
        names = (actuator["name"] or f"actuator {number}" for number, actuator in actuators)
        return cls(recorded, now, tuple(names), frozenset(limited))

    @property
    def differ(self) -> bool:
        return self.recorded != self.now

    def moved_otherwise(self, entry: _core.JournalEntry) -> str:
        """The first actuator that a taken batch may move otherwise; empty: none."""
        if not self.differ or entry.kind != "taken":
            return ""
        for record in entry.records:
            for target in record.targets:
                if target.actuator in self.limited or record.profile != "linear":
                    return self.names[target.actuator]
        return ""

    def __str__(self) -> str:
        return f"it moved by motion rules {self.recorded}, this o80 has motion rules {self.now}"
