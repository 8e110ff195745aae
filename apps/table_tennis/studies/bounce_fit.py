"""Fits lift and grip to recorded bounces.

The spin of a recorded ball is not measured, only its effect on the flight. Lift (effect of the
spin on the flight) and grip (effect of the spin at the bounce) are therefore fitted together: to
the velocity along the table after each bounce and, with less weight, to the turn after it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from o80.base.arrays import FloatArray
from o80_table_tennis.balls.flight_fit import FlightFit
from o80_table_tennis.physics.aerodynamics import AERODYNAMICS, Aerodynamics
from o80_table_tennis.physics.impact import bounced
from o80_table_tennis.world.table import TABLE, Table

SPEED_ERROR = 0.1
"""Expected error of a velocity after a bounce [m/s]."""
TURN_ERROR = 0.1
"""Expected error of a turn after a bounce [1/s]."""
LONG_FLIGHT = 30
"""Least number of rows after a bounce that determine the turn."""
ROLLING = 0.4
"""Grip of a hollow ball that leaves the table rolling."""
GRIP_ERROR = 0.03
"""Expected deviation of the grip from ROLLING."""
BOUNDS = np.array([[0.2, 0.0, 0.2], [3.0, 3.0, 0.6]])
"""Bounds of lift coefficient, lift saturation and grip. With more saturation, a turn would
hardly determine the spin."""
STARTS = [(lift, saturation, 0.43) for lift in (0.5, 1.0, 1.5) for saturation in (0.5, 2.7)]
MAX_ROUNDS = 60


@dataclass(frozen=True, eq=False)
class RecordedBounce:
    """Recorded bounce, with the flights before and after."""

    before: FloatArray
    """(3,) velocity [m/s]"""
    after: FloatArray
    """(3,) velocity [m/s]"""
    turn_before: FloatArray
    """(3,) [1/s]"""
    turn_after: FloatArray
    """(3,) [1/s]"""
    speed_after: float
    """Mean speed of the flight after the bounce [m/s]."""
    rows_after: int

    @classmethod
    def of(cls, fit: FlightFit, stamps: FloatArray) -> RecordedBounce | None:
        """Extracts the first bounce of a fitted flight; None if there is none."""
        if len(fit.bounce_times) == 0:
            return None
        at = fit.bounce_times[:1]
        end = fit.end if len(fit.bounce_times) == 1 else float(fit.bounce_times[1])
        later = np.linspace(float(at[0]), end, 20)
        return cls(
            before=fit.flights[0].at(at)[1][0],
            after=fit.flights[1].at(at)[1][0],
            turn_before=fit.flights[0].turn,
            turn_after=fit.flights[1].turn,
            speed_after=float(np.linalg.norm(fit.flights[1].at(later)[1], axis=1).mean()),
            rows_after=int(np.sum((stamps > at[0]) & (stamps <= end))),
        )


@dataclass(frozen=True)
class Law:
    """Parameters of air and table for predictions."""

    air: Aerodynamics = AERODYNAMICS
    table: Table = TABLE

    @classmethod
    def of(cls, numbers: FloatArray) -> Law:
        """Makes a law with these lift coefficient, lift saturation and grip (3,)."""
        lift, saturation, grip = numbers.tolist()
        return cls(
            replace(AERODYNAMICS, lift_coefficient=lift, lift_saturation=saturation),
            replace(TABLE, tangential_restitution=1.0 - grip),
        )

    def spin(self, bounce: RecordedBounce) -> FloatArray:
        """Computes the ball's spin before the bounce (3,) [rad/s]."""
        speed = np.array([np.linalg.norm(bounce.before)])
        spin: FloatArray = self.air.spins(bounce.turn_before, speed)[0]
        return spin

    def predicted(self, bounce: RecordedBounce) -> tuple[FloatArray, FloatArray]:
        """Predicts velocity [m/s] and turn [1/s] after the bounce, each (3,)."""
        after = bounced(bounce.before, self.spin(bounce), self.table)
        return after.velocity, self.air.turn(after.spin, bounce.speed_after)


def errors(law: Law, bounces: Sequence[RecordedBounce]) -> FloatArray:
    """Computes predicted minus recorded velocity along the table (N,) [m/s]."""
    return np.array([law.predicted(bounce)[0][1] - bounce.after[1] for bounce in bounces])


def fitted(bounces: Sequence[RecordedBounce]) -> FloatArray:
    """Fits lift coefficient, lift saturation and grip (3,) to the bounces."""

    def misses(numbers: FloatArray) -> FloatArray:
        law = Law.of(numbers)
        found = [(float(numbers[2]) - ROLLING) / GRIP_ERROR]
        for bounce in bounces:
            velocity, turn = law.predicted(bounce)
            found.append((float(velocity[1]) - float(bounce.after[1])) / SPEED_ERROR)
            if bounce.rows_after >= LONG_FLIGHT:
                found.append(float(turn[0] - bounce.turn_after[0]) / TURN_ERROR)
        return np.array(found)

    found = [_least_squares(misses, np.array(start)) for start in STARTS]
    return min(found, key=lambda each: each[1])[0]


def _least_squares(
    misses: Callable[[FloatArray], FloatArray], numbers: FloatArray
) -> tuple[FloatArray, float]:
    """Minimises by Levenberg-Marquardt within the bounds; also returns the sum of squares."""
    damping, error = 1e-2, misses(numbers)
    for _ in range(MAX_ROUNDS):
        slopes = np.column_stack([(misses(numbers + 1e-5 * e) - error) / 1e-5 for e in np.eye(3)])
        for _ in range(8):
            matrix = slopes.T @ slopes + damping * np.eye(3)
            there = np.clip(numbers - np.linalg.solve(matrix, slopes.T @ error), *BOUNDS)
            error_there = misses(there)
            if error_there @ error_there < error @ error:
                break
            damping *= 4.0
        else:
            break
        moved = float(np.abs(there - numbers).max())
        numbers, error, damping = there, error_there, damping / 3.0
        if moved < 1e-5:
            break
    return numbers, float(error @ error)
