"""Laws of flight and bounce of the simulated balls, for predictions and fits.

The simulator uses the same code: a ball predicted with the numbers of its options flies as in
the simulation, but for the errors of other steps. A ball is nine numbers: position [m],
velocity [m/s] and spin [rad/s], in the world frame.
"""

from o80_mujoco._balls import (
    Air,
    BallFilter,
    Platform,
    accelerations,
    bounced,
    path,
    predicted_flight,
)

__all__ = [
    "Air",
    "BallFilter",
    "Platform",
    "accelerations",
    "bounced",
    "path",
    "predicted_flight",
]
