"""Conditions of a policy: arm, actions and observation. A learned policy holds its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

from ..settings import Pacing, RigSettings, TaskSettings
from ..task.noise import NoiseSettings


@dataclass(frozen=True)
class Conditions:
    """Arm, actions, observation and reward; the defaults are those of the training."""

    preset: str = "identified"
    """Preset of the simulated arm."""
    observation: str = "full"
    """published (22 numbers) or full, see `task.full_observation`."""
    ball_position_noise: float = 0.005
    """Noise of the observed ball, along each axis [m]: as a camera system leaves it."""
    ball_velocity_noise: float = 0.1
    """[m/s]"""
    start_noise: float = 0.02
    """On each joint at the start of an episode, uniform in plus or minus this [rad]."""
    factor: float = 0.6
    """Factor of the actions."""
    repeat: int = 2
    """Steps of 10 ms that an action lasts."""
    chunk_size: int | None = None
    """Rows of an action chunk, see `settings.TaskSettings` for this and the next two."""
    action_steps: int = 1
    delay: int = 1
    reward: str = "ordered"
    balls: str = "wide"
    """Simulated shots: wide, narrow or launcher; or a path of recordings."""

    def rig(self, pacing: Pacing = Pacing.INLINE) -> RigSettings:
        """The arm and its twin."""
        return RigSettings(pacing=pacing, preset=self.preset)

    def task(self, *, ball_seed: int = 0, fly_out: bool = True) -> TaskSettings:
        """The task; each `ball_seed` has simulated shots of its own.

        Without `fly_out` the rows of the ball's flight after the touch are there, for a film.
        """
        return TaskSettings(
            balls=self.balls,
            ball_seed=ball_seed,
            factor=self.factor,
            repeat=self.repeat,
            chunk_size=self.chunk_size,
            action_steps=self.action_steps,
            delay=self.delay,
            reward=self.reward,
            observation=self.observation,
            noise=NoiseSettings(
                ball_position=self.ball_position_noise,
                ball_velocity=self.ball_velocity_noise,
                start_posture=self.start_noise,
            ),
            fly_out=fly_out,
        )

    def playing(self, balls: str | None) -> Conditions:
        """The same with other balls, if any are named."""
        return self if balls is None else replace(self, balls=balls)

    def as_json(self) -> dict[str, Any]:
        """By name."""
        return asdict(self)

    @classmethod
    def of_json(cls, values: Mapping[str, Any]) -> Conditions:
        """Conditions from the values of a file. Raises ValueError for names that are unknown."""
        known = [each.name for each in fields(cls)]
        unknown = [name for name in values if name not in known]
        if unknown:
            raise ValueError(
                f"unknown conditions: {', '.join(unknown)}; the file is of another version"
            )
        return cls(**values)
