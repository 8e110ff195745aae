"""One policy plays the same balls accelerated and in real time: the results ball by ball."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..report.statistics import Played


@dataclass(frozen=True)
class Paired:
    """How many balls were returned in which way, and how many actions were late in real time."""

    both: int
    only_accelerated: int
    only_real_time: int
    neither: int
    actions: int
    """In real time."""
    late_actions: int
    """Actions that were sent after their iteration had begun, and acted at once."""
    stalled_episodes: int
    """Episodes that ended because the player fell too far behind."""

    @classmethod
    def of(cls, accelerated: Played, real_time: Played) -> Paired:
        """Pairs two evaluations of the same balls. Raises ValueError if the balls differ."""
        if [each.ball for each in accelerated.episodes] != [
            each.ball for each in real_time.episodes
        ]:
            raise ValueError("both evaluations must play the same balls in the same order")
        pairs = [
            (one.returned, other.returned)
            for one, other in zip(accelerated.episodes, real_time.episodes, strict=True)
        ]
        played = real_time.statistics
        return cls(
            both=pairs.count((True, True)),
            only_accelerated=pairs.count((True, False)),
            only_real_time=pairs.count((False, True)),
            neither=pairs.count((False, False)),
            actions=played.steps,
            late_actions=played.late_actions,
            stalled_episodes=played.stalled_episodes,
        )

    @property
    def balls(self) -> int:
        """How many were played."""
        return self.both + self.only_accelerated + self.only_real_time + self.neither

    def as_json(self) -> dict[str, Any]:
        """The figures."""
        return {
            "balls": self.balls,
            "returned_both": self.both,
            "returned_only_accelerated": self.only_accelerated,
            "returned_only_real_time": self.only_real_time,
            "actions": self.actions,
            "late_actions": self.late_actions,
            "stalled_episodes": self.stalled_episodes,
        }

    def __str__(self) -> str:
        more = self.only_real_time - self.only_accelerated
        return (
            f"of {self.balls} balls, {self.both} were returned both ways, "
            f"{self.only_accelerated} only accelerated, {self.only_real_time} only in real time "
            f"(difference {100 * more / max(1, self.balls):+.1f} points); in real time "
            f"{self.late_actions} of {self.actions} actions were late, and "
            f"{self.stalled_episodes} episodes were lost to that"
        )
