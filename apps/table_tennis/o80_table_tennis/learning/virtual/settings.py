"""Settings of the comparison: frozen values. The ways of learning differ in balls and steps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from o80.base.argument_checks import whole

from ...players.conditions import Conditions
from .hindsight import Selection, best_balls, every_ball

CONDITIONS = Conditions(
    observation="published", ball_position_noise=0.0, ball_velocity_noise=0.0, repeat=4
)
"""Wide shots and the arm as identified, but no noise of the ball, which makes outcomes random, and
25 decisions a second: SAC learns from fewer motions so."""


@dataclass(frozen=True)
class Way:
    """Way to learn from one motion of the arm."""

    text: str
    virtual_balls: int = 0
    """Balls that meet each motion beside the played one."""
    select: Selection = every_ball
    gradient_steps: int = 20
    """After each motion."""


WAYS: Mapping[str, Way] = {
    "none": Way("no virtual balls"),
    "more_steps": Way("no virtual balls, as many gradient steps as with them", gradient_steps=40),
    "all": Way("20 virtual balls", virtual_balls=20, gradient_steps=40),
    "selected": Way("the 4 best of 20 virtual balls", 20, best_balls(4), gradient_steps=40),
}
"""By name, as they are compared."""


@dataclass(frozen=True)
class SacSettings:
    """Settings of Stable-Baselines3's SAC."""

    buffer: int = 500_000
    """Transitions that are kept."""
    batch: int = 256
    learning_rate: float = 1e-3
    discount: float = 0.97
    target_rate: float = 0.01
    """Rate at which the target networks follow the learned ones, in each gradient step."""
    entropy: str = "auto_0.02"
    """Weight of the entropy: learned, from this on."""
    hidden: int = 64
    """Units of each of two hidden layers, of the policy and of the values."""


@dataclass(frozen=True)
class VirtualSettings:
    """One training."""

    way: str = "none"
    seed: int = 1
    motions: int = 1000
    """Motions of the arm; the first ones have random actions."""
    random_motions: int = 20
    """Nothing is learned before; the observations are scaled by what is seen in them."""
    evaluate_every: int = 50
    """Motions between two evaluations."""
    evaluated: int = 200
    """Balls of an evaluation."""
    conditions: Conditions = CONDITIONS
    sac: SacSettings = SacSettings()

    def __post_init__(self) -> None:
        if self.way not in WAYS:
            raise ValueError(f"unknown way '{self.way}'; there are: {', '.join(WAYS)}")
        whole(self.seed, "seed", 0)
        for name in ("motions", "random_motions", "evaluate_every", "evaluated"):
            whole(getattr(self, name), name, 1)
