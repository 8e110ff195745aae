"""Compares a policy's results ball by ball, accelerated and in real time."""

from __future__ import annotations

from dataclasses import dataclass

from ..report.statistics import Played


@dataclass(frozen=True)
class Paired:
    """Counts of balls returned in either pacing or both, and of late actions in real time."""

    balls: int
    returned_both: int
    returned_only_accelerated: int
    returned_only_real_time: int
    actions: int
    """Number of actions in real time."""
    late_actions: int
    """Number of actions that were sent after their iteration began, and acted at once."""
    stalled_episodes: int
    """Number of episodes that ended because the policy was too slow."""

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
