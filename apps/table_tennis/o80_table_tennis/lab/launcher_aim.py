"""Where the launcher stands, and how it is aimed: at balls like the simulated shots `wide`.

The recorded launcher stands on the floor and shoots faster than the policies know. Here it is
raised so far that its balls leave it where those of the ball gun begin.
"""

from __future__ import annotations

import math

import numpy as np

from o80_devices.ball_launcher.launch_model import LAUNCH_MODEL
from o80_devices.ball_launcher.wheel_speeds import actuation_of

from ..balls.launches import WIDE
from ..balls.recordings import Frame

_X, _Y, _Z = WIDE.position
PLACE = Frame(offset=(_X, _Y, _Z - LAUNCH_MODEL.muzzle[2]), yaw=-math.pi / 2)
"""Place of the launcher in the world: it shoots along -y."""
TOP_SPINS = (0.0, 60.0)
"""Least and most [rad/s]: with the scatter of the launcher, within those of `wide`."""
SPREAD = 0.2
"""Spread of each component of the velocity, either way [m/s]; the launcher adds its scatter."""


def drawn_aim(rng: np.random.Generator) -> list[float]:
    """Angles and motors (5,) of the launcher for another ball; the same `rng`, the same aim."""
    share = rng.uniform(-1.0, 1.0, 3)
    velocity = np.array(WIDE.velocity) + SPREAD * share
    least, most = TOP_SPINS
    return aim_at(velocity, rng.uniform(least, most))


def aim_at(velocity: np.ndarray[tuple[int, ...], np.dtype[np.float64]], spin: float) -> list[float]:
    """For a velocity (3,) in the world [m/s] and a top spin [rad/s]: the launch model, inverted."""
    model = LAUNCH_MODEL
    aside, ahead, up = velocity[0], -velocity[1], velocity[2]
    difference = (spin - model.spin) / model.spin_gain  # of the upper motors to the lower one
    speed = float(np.linalg.norm(velocity))
    bottom = (speed - 2 * model.top_gain * difference) / (2 * model.top_gain + model.bottom_gain)
    azimuth, altitude = math.atan2(aside, ahead), math.atan2(up, math.hypot(aside, ahead))
    phi = 0.5 + (azimuth - model.azimuth) / model.azimuth_range
    theta = 0.5 + (altitude - model.altitude - model.lift * difference) / model.altitude_range
    upper = actuation_of(bottom + difference)
    return [phi, theta, upper, upper, actuation_of(bottom)]
