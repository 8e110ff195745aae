"""Simulates shots of the ball launcher with the launch model of o80-devices."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from o80.base.extras import needed

from .launches import WIDE, Launch
from .recordings import LAUNCHER_FRAME

if TYPE_CHECKING:
    from o80_devices.ball_launcher import LaunchModel

SETTINGS = ((1200.0, 1200.0, 1200.0), (1800.0, 1800.0, 400.0))
"""Motor speeds [1/min] without and with top spin, as in the recorded shots."""
TOP_SPINS = (0.0, 60.0)
"""Range of an aim's top spin [rad/s]; with the launcher's scatter, within the range of `WIDE`."""
SPREAD = 0.2
"""Spread of each component of an aim's velocity, either way; the scatter is added [m/s]."""


@dataclass(frozen=True)
class LauncherShots:
    """Motor speeds drawn between the two recorded settings, with the scatter of the launcher.

    The launcher is at the far end of the table and shoots at the arm.
    """

    def draw(self, rng: np.random.Generator) -> Launch:
        """Draws a launch. Raises o80.MissingExtra without the package o80-devices."""
        model, share = _model(), rng.uniform()
        left, right, bottom = (
            (1 - share) * plain + share * top for plain, top in zip(*SETTINGS, strict=True)
        )
        ball = model.launch(0.5, 0.5, (left, right, bottom), rng)
        ball = ball.placed(LAUNCHER_FRAME.offset, LAUNCHER_FRAME.yaw)
        return Launch(ball.position, ball.velocity, ball.spin)


def _model() -> LaunchModel:
    devices: Any = needed(
        "o80_devices.ball_launcher", None, "a shot of the launcher", package="o80-devices"
    )
    model: LaunchModel = devices.LAUNCH_MODEL
    return model


LAUNCHER = LauncherShots()
"""Shots like the recorded launcher's, also between its two settings."""


def drawn_aim(rng: np.random.Generator) -> list[float]:
    """Draws angles and motors (5,) for a ball like `WIDE`, by the inverse of the launch model."""
    from o80_devices.ball_launcher.wheel_speeds import actuation_of

    model = _model()
    velocity = np.array(WIDE.velocity) + SPREAD * rng.uniform(-1.0, 1.0, 3)
    difference = (rng.uniform(*TOP_SPINS) - model.spin) / model.spin_gain  # of motor speeds
    speed = float(np.linalg.norm(velocity))
    bottom = (speed - 2 * model.top_gain * difference) / (2 * model.top_gain + model.bottom_gain)
    aside, ahead, up = velocity[0], -velocity[1], velocity[2]
    azimuth, altitude = math.atan2(aside, ahead), math.atan2(up, math.hypot(aside, ahead))
    phi = 0.5 + (azimuth - model.azimuth) / model.azimuth_range
    theta = 0.5 + (altitude - model.altitude - model.lift * difference) / model.altitude_range
    upper = actuation_of(bottom + difference)
    return [phi, theta, upper, upper, actuation_of(bottom)]
