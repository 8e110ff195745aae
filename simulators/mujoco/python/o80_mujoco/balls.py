"""The laws by which simulated balls fly and bounce, for predictions and fits.

They are the simulator's own: a ball that is predicted with the numbers of its options flies as in
the simulation. A ball is nine numbers: position [m], velocity [m/s] and spin [rad/s], in the axes
of the world.
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
