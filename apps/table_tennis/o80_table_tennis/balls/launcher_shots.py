"""Shots of the ball launcher, by the launch model of the package o80-devices."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from o80.base.extras import needed

from .launches import Launch
from .recordings import LAUNCHER_FRAME

if TYPE_CHECKING:
    from o80_devices.ball_launcher import LaunchModel

SETTINGS = ((1200.0, 1200.0, 1200.0), (1800.0, 1800.0, 400.0))
"""Motor speeds [1/min] without and with top spin, as in the recorded shots."""


@dataclass(frozen=True)
class LauncherShots:
    """Motor speeds drawn between the two recorded settings, with the scatter of the launcher.

    It stands at the far end of the table and shoots at the arm.
    """

    def draw(self, rng: np.random.Generator) -> Launch:
        """Another launch. Raises o80.MissingExtra without the package o80-devices."""
        model: LaunchModel = needed(
            "o80_devices.ball_launcher", None, "a shot of the launcher", package="o80-devices"
        ).LAUNCH_MODEL
        share = rng.uniform()
        left, right, bottom = (
            (1 - share) * plain + share * top for plain, top in zip(*SETTINGS, strict=True)
        )
        ball = model.launch(0.5, 0.5, (left, right, bottom), rng)
        ball = ball.placed(LAUNCHER_FRAME.offset, LAUNCHER_FRAME.yaw)
        return Launch(ball.position, ball.velocity, ball.spin)


LAUNCHER = LauncherShots()
"""Like the shots of the recorded launcher, and between its two settings."""
