"""Settings of a training: frozen values, with those that the search found as defaults."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from o80.base.argument_checks import whole

from ..players.conditions import Conditions


@dataclass(frozen=True)
class PpoSettings:
    """Settings of Stable-Baselines3's PPO; studies/search_settings.py tries others."""

    environments: int = 32
    """Copies that are stepped side by side."""
    steps: int = 64
    """Decisions of each environment between two updates."""
    batch: int = 512
    epochs: int = 5
    """Times that an update sees each decision."""
    learning_rate: float = 1e-3
    """At the start; it falls linearly to `last_rate` of that."""
    last_rate: float = 0.05
    discount: float = 0.995
    trace: float = 0.95
    """Lambda of the generalised advantage estimate."""
    clip: float = 0.2
    entropy: float = 0.0
    hidden: int = 64
    """Units of each of two hidden layers, of the policy and of the value."""
    log_exploration: float = -0.5
    """Logarithm of the standard deviation of the actions at the start."""
    last_log_exploration: float | None = None
    """The same at the end; it falls linearly with the decisions. None: it is learned."""

    def __post_init__(self) -> None:
        for name in ("environments", "steps", "batch", "epochs", "hidden"):
            whole(getattr(self, name), name, 1)
        for name in ("learning_rate", "discount", "trace", "clip"):
            value = getattr(self, name)
            if not 0 < value < math.inf:
                raise ValueError(f"{name} must be a positive number, got {value}")
        for name in ("log_exploration", "last_log_exploration"):
            value = getattr(self, name)
            if value is not None and not math.isfinite(value):
                raise ValueError(f"{name} must be a finite number, got {value}")

    def log_exploration_at(self, share: float) -> float | None:
        """After a share of the training; None if it is learned."""
        if self.last_log_exploration is None:
            return None
        first, last = self.log_exploration, self.last_log_exploration
        return first + (last - first) * min(share, 1.0)


@dataclass(frozen=True)
class RestartSettings:
    """When a network that has got stuck is replaced, see `LearningSettings.stuck`."""

    after: int = 600_000
    """A network is judged once, after so many decisions of its own."""
    touched: float = 0.65
    """Share of the balls that it must touch by then, with exploration; 0: all are kept."""

    def __post_init__(self) -> None:
        whole(self.after, "after", 1)
        if not 0 <= self.touched <= 1:
            raise ValueError(f"touched must lie in [0, 1], got {self.touched}")


@dataclass(frozen=True)
class LearningSettings:
    """A whole training. Raises ValueError or TypeError."""

    conditions: Conditions = field(default_factory=Conditions)
    ppo: PpoSettings = field(default_factory=PpoSettings)
    restart: RestartSettings = field(default_factory=RestartSettings)
    seed: int = 1
    decisions: int = 4_000_000
    """After which the training ends."""
    minutes: float = math.inf
    """After which it ends at the latest [min]."""
    blind: bool = False
    """The ball is masked; the policy sees the arm and the time."""
    evaluate_every: int = 100_000
    """Decisions between two evaluations of the deterministic policy."""
    evaluated: int = 100
    """Balls of such an evaluation."""

    def __post_init__(self) -> None:
        whole(self.seed, "seed", 0)
        for name in ("decisions", "evaluate_every", "evaluated"):
            whole(getattr(self, name), name, 1)
        if not self.minutes > 0:
            raise ValueError(f"minutes must be positive, got {self.minutes}")

    def stuck(self, *, begun: int, decisions: int, touched: float) -> bool:
        """Whether a network that began at the decision `begun` should be replaced now.

        Some networks learn early to return the balls that fly to one side, and never learn the
        others. Longer training does not help them, see docs/results/learning.md. A low share of
        touched balls shows this before half of the training is over.

        A network is judged once, in the first update after `restart.after` decisions. It is kept
        if a new network could not be judged before the end of the training. A blind network is
        always kept, because it cannot touch so many balls.

        touched: share of the last balls, with exploration.
        """
        restart, age = self.restart, decisions - begun
        update = self.ppo.steps * self.ppo.environments
        judged = restart.after <= age < restart.after + update
        enough_left = self.decisions - decisions >= restart.after
        return judged and enough_left and not self.blind and touched < restart.touched


WAYS: Mapping[str, LearningSettings] = {
    "ours": LearningSettings(),
    "published": LearningSettings(
        conditions=Conditions(
            preset="published_simulation",
            factor=0.05,
            repeat=1,
            reward="published",
            observation="published",
            balls="narrow",
            ball_position_noise=0.0,
            ball_velocity_noise=0.0,
        ),
        ppo=PpoSettings(
            discount=0.9999,
            trace=1.0,
            learning_rate=1.5e-4,
            clip=0.4,
            hidden=380,
            steps=160,
        ),
        restart=RestartSettings(touched=0.0),
    ),
}
"""Sets of settings by name; `published`: fine actions, the published simulation and reward."""
