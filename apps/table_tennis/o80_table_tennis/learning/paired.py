"""One policy plays the same balls accelerated and in real time: the results ball by ball."""

from __future__ import annotations

from dataclasses import dataclass

from ..report.statistics import Played


@dataclass(frozen=True)
class Paired:
    """How many balls were returned in which way, and how many actions were late in real time."""

    balls: int
    returned_both: int
    returned_only_accelerated: int
    returned_only_real_time: int
    actions: int
    """In real time."""
    late_actions: int
    """Actions that were sent after their iteration had begun, and acted at once."""
    stalled_episodes: int
    """Episodes that ended because the player fell too far behind."""

    @classmethod
    def of(cls, accelerated: Played, real_time: Played) -> Paired:
        """Pairs two evaluations of the same balls. Raises ValueError if the balls differ."""
        pairs = [*zip(accelerated.episodes, real_time.episodes, strict=True)]
        if any(one.ball != other.ball for one, other in pairs):
            raise ValueError("both evaluations must play the same balls in the same order")
        returned = [(one.returned, other.returned) for one, other in pairs]
        both, one, other = map(returned.count, ((True, True), (True, False), (False, True)))
        played = real_time.statistics
        late, stalled = played.late_actions, played.stalled_episodes
        return cls(len(pairs), both, one, other, played.steps, late, stalled)

    def __str__(self) -> str:
        more = self.returned_only_real_time - self.returned_only_accelerated
        return (
            f"of {self.balls} balls, {self.returned_both} were returned both ways, "
            f"{self.returned_only_accelerated} only accelerated, {self.returned_only_real_time} "
            f"only in real time (difference {100 * more / max(1, self.balls):+.1f} points); in "
            f"real time {self.late_actions} of {self.actions} actions were late, and "
            f"{self.stalled_episodes} episodes were lost to that"
        )
