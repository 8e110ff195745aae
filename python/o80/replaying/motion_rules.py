"""What other rules of motion than those of this o80 mean for a replay."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from o80 import _core


@dataclass(frozen=True)
class MotionRules:
    """The rules of a recorded run and of this o80.

    Under other rules, commands of actuators with an acceleration limit may move otherwise.
    """

    recorded: int
    now: int
    limited: dict[int, str]  #: actuators with an acceleration limit: names by number

    @classmethod
    def of(cls, schema: dict[str, Any], recorded: int, now: int) -> MotionRules:
        limited = {
            number: actuator["name"] or f"actuator {number}"
            for number, actuator in enumerate(schema["actuators"])
            if any(limit["acceleration"] is not None for limit in actuator["limits"])
        }
        return cls(recorded, now, limited)

    @property
    def differ(self) -> bool:
        return self.recorded != self.now

    def moved_otherwise(self, entry: _core.JournalEntry) -> str:
        """The first actuator that a taken batch may move otherwise; empty: none."""
        if not self.differ or entry.kind != "taken":
            return ""
        for record in entry.records:
            for target in record.targets:
                if target.actuator in self.limited:
                    return self.limited[target.actuator]
        return ""

    def __str__(self) -> str:
        return f"it moved by motion rules {self.recorded}, this o80 has motion rules {self.now}"
