"""Extended Kalman filter of a flying ball, with the law of flight and bounce."""

from __future__ import annotations

import numpy as np

from o80.base.arrays import FloatArray
from o80_devices.cameras.flight import FlightLaw

ACCELERATION_NOISE = 0.02  # white noise of the acceleration [m^2/s^3]
SPIN_NOISE = 50.0  # white noise of the change of the spin [rad^2/s^3]
BOUNCE_VELOCITY = 0.25  # standard deviation added by a bounce [m/s]
BOUNCE_SPIN = 20.0  # [rad/s]
FIRST_VELOCITY = 8.0  # standard deviation of an unknown velocity in each direction [m/s]
FIRST_SPIN = 60.0  # [rad/s]
REACH = np.repeat([1e-5, 1e-4, 1e-2], 3)  # steps of the numeric derivatives
SIDES = np.stack([-np.diag(REACH), np.diag(REACH)], axis=1)  # (9, 2, 9)
GATE = 25.0
"""Largest squared distance of a point of the same flight, in standard deviations."""


class BallFilter:
    """Estimate of position, velocity and spin: `ball` (9,), and its `covariance` (9, 9)."""

    def __init__(self, law: FlightLaw) -> None:
        self._law = law
        self.ball = np.zeros(9)
        self.covariance = np.zeros((9, 9))

    def begin(
        self,
        point: FloatArray,
        covariance: FloatArray,
        velocity: FloatArray | None = None,
        spread: float = FIRST_VELOCITY,
    ) -> None:
        """Starts at a point (3,). velocity: None: unknown. spread: its standard deviation [m/s]."""
        self.ball = np.zeros(9)
        self.ball[:3] = point
        self.ball[3:6] = 0.0 if velocity is None else velocity
        self.covariance = np.diag(np.repeat([0.0, spread**2, FIRST_SPIN**2], 3))
        self.covariance[:3, :3] = covariance

    def predict(self, duration: float) -> None:
        """Predicts the state after a time of at least 0 [s]."""
        end, bounces = self._law.advance(self.ball, duration)
        slope = self._slope(duration, end, bounces)
        velocity = ACCELERATION_NOISE * duration + bounces * BOUNCE_VELOCITY**2
        noise = np.zeros((3, 3))
        noise[:2, :2] = [[duration**2 / 3, duration / 2], [duration / 2, 1.0]]
        noise *= velocity
        noise[2, 2] = SPIN_NOISE * duration + bounces * BOUNCE_SPIN**2
        self.ball = end
        self.covariance = slope @ self.covariance @ slope.T + np.kron(noise, np.eye(3))

    def distance(self, point: FloatArray, covariance: FloatArray) -> float:
        """Squared distance of a point (3,) from the estimate, in standard deviations."""
        apart = point - self.ball[:3]
        return float(apart @ np.linalg.solve(self.covariance[:3, :3] + covariance, apart))

    def update(self, point: FloatArray, covariance: FloatArray) -> None:
        """Corrects the estimate by a seen point (3,)."""
        gain = self.covariance[:, :3] @ np.linalg.inv(self.covariance[:3, :3] + covariance)
        self.ball = self.ball + gain @ (point - self.ball[:3])
        # Joseph's form keeps the covariance symmetric and positive
        rest = np.eye(9)
        rest[:, :3] -= gain
        self.covariance = rest @ self.covariance @ rest.T + gain @ covariance @ gain.T

    def _slope(self, duration: float, end: FloatArray, bounces: int) -> FloatArray:
        """Derivatives (9, 9) of the predicted ball `end`."""
        slope = np.eye(9)
        for i, sides in enumerate(self.ball + SIDES):
            # a side with another number of bounces gives no slope
            (low, below), (high, above) = (
                (ball, REACH[i]) if count == bounces else (end, 0.0)
                for ball, count in (self._law.advance(side, duration) for side in sides)
            )
            if below + above > 0.0:
                slope[:, i] = (high - low) / (below + above)
        return slope
