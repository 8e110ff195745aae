"""Conditions of a policy: arm, actions and observation. A learned policy stores its conditions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from ..settings import Pacing, RigSettings, TaskSettings
from ..task.noise import NoiseSettings


@dataclass(frozen=True)
class Conditions:
    """Arm, actions, observation and reward; the defaults are the training's."""

    preset: str = "identified"
    """Preset of the simulated arm."""
    observation: str = "full"
    """published (22 numbers) or full, see `task.full_observation`."""
    ball_position_noise: float = 0.005
    """Noise of the observed ball along each axis, as of a camera system [m]."""
    ball_velocity_noise: float = 0.1
    """[m/s]"""
    start_noise: float = 0.02
    """Largest deviation of each joint at the start of an episode, either way, uniform [rad]."""
    factor: float = 0.6
    """Factor of the actions."""
    repeat: int = 2
    """Duration of an action in steps of 10 ms."""
    delay: int = 1
    """Iterations from an observation to its action, minus 1, see `settings.TaskSettings`."""
    goal: str = "return"
    """return or smash."""
    reward: str = "ordered"
    balls: str = "wide"
    """Simulated shots: wide, narrow or launcher; or a path of recordings."""

    def rig(self, pacing: Pacing = Pacing.INLINE) -> RigSettings:
        """Returns the settings of arm and twin."""
        return RigSettings(pacing=pacing, preset=self.preset)

    def task(self, *, ball_seed: int = 0, fly_out: bool = True) -> TaskSettings:
        """Returns the settings of the task; each `ball_seed` gives other simulated shots.

        Without `fly_out`, the flight after the touch has rows, for a film.
        """
        return TaskSettings(
            task=self.goal,
            balls=self.balls,
            ball_seed=ball_seed,
            factor=self.factor,
            repeat=self.repeat,
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

    @classmethod
    def of_options(cls, options: Mapping[str, Any]) -> Conditions:
        """Converts a training's options, without the options of stepping."""
        known = [each.name for each in fields(cls)]
        return cls(**{name: value for name, value in options.items() if name in known})
