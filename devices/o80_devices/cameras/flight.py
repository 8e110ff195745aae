"""Forces on the ball, the table, and the flight that follows from them.

The law of flight and bounce is that of the simulated balls (`o80_mujoco.balls`): needs the extra
`balls`. A ball is nine numbers: position [m], velocity [m/s] and spin [rad/s], in the world frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from o80.base.arrays import FloatArray
from o80.base.extras import needed
from o80.errors import InvalidArgument

Vector = tuple[float, float, float]
LONGEST_STEP = 0.01
"""Step of the integration [s]."""


@dataclass(frozen=True)
class Flight:
    """Forces of air and gravity on the ball, as `o80_mujoco.balls.Air` has them.

    The defaults match the balls of the table-tennis application.
    """

    radius: float = 0.02
    """[m]"""
    drag: float = 0.1098
    """[1/m]"""
    magnus: float = 0.00626
    saturation: float = 0.06
    """Saturation of the lift [m]."""
    spin_decay: float = 0.5
    """[1/s]"""
    gravity: Vector = (0.0, 0.0, -9.81)
    """Along z [m/s^2]."""


@dataclass(frozen=True)
class Table:
    """A table on which the ball bounces; its edges are parallel to the axes of the world."""

    middle: Vector = (0.4, 1.57, 0.775)
    """Middle of the surface [m]."""
    half: tuple[float, float] = (0.7625, 1.37)
    """Half the width along x and half the length along y [m]."""
    kept_normal: float = 0.92
    kept_tangential: float = 0.505
    friction: float = 0.25

    @property
    def corners(self) -> FloatArray:
        """Corners (4, 3) of the surface [m], counter-clockwise from the smallest x and y."""
        signs = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
        corners: FloatArray = np.asarray(self.middle) + signs * (*self.half, 0.0)
        return corners


class FlightLaw:
    """Flight of a ball, with bounces on the table, if any."""

    def __init__(self, flight: Flight, table: Table | None) -> None:
        """Raises MissingExtra without o80-mujoco, TypeError or ValueError for wrong numbers."""
        balls = needed("o80_mujoco.balls", "balls", "the flight of a ball", package="o80-devices")
        if any(flight.gravity[:2]):
            raise InvalidArgument(f"gravity must point along z, got {flight.gravity}")
        self._predicted_flight = balls.predicted_flight
        self._air = balls.Air(
            drag=flight.drag,
            magnus=flight.magnus,
            spin_decay=flight.spin_decay,
            gravity=-flight.gravity[2],
            saturation=flight.saturation,
        )
        self._platform = None
        if table is not None:
            (x, y, height), (across, along) = table.middle, table.half
            self._platform = balls.Platform(
                height=height + flight.radius,
                low=(x - across, y - along),
                high=(x + across, y + along),
                restitution=(table.kept_tangential, table.kept_tangential, table.kept_normal),
                friction=table.friction,
                radius=flight.radius,
            )

    def path(self, ball: FloatArray, duration: float, step: float = LONGEST_STEP) -> FloatArray:
        """Flight of a ball (9,): rows (K, 11) of time [s], ball, and 1 after a bounce, else 0."""
        rows: FloatArray = self._predicted_flight(ball, self._air, self._platform, duration, step)
        return rows

    def advance(self, ball: FloatArray, duration: float) -> tuple[FloatArray, int]:
        """The ball (9,) after a time of at least 0 [s], and the number of bounces until then."""
        rows = self.path(ball, duration)
        return rows[-1, 1:10], int(np.count_nonzero(rows[:, 10]))
