"""Smooth joint motions: from the present motion to the strike, and then to rest."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from o80.base.arrays import FloatArray


@dataclass(frozen=True)
class JointMotion:
    """Angles, speeds and accelerations of the joints at one time, each (4,)."""

    q: FloatArray
    """[rad]"""
    dq: FloatArray
    """[rad/s]"""
    ddq: FloatArray
    """[rad/s^2]"""


@dataclass(frozen=True)
class Swing:
    """Fifth-degree polynomial for each joint, continued at its final speed."""

    coefficients: FloatArray
    """(6, 4), of the powers of time"""
    duration: float
    """[s]"""
    gone: float = 0.0
    """Elapsed part of the duration [s]."""

    @classmethod
    def resting_at(cls, q: FloatArray) -> Swing:
        """Makes a motion at rest at q (4,) [rad]."""
        coefficients = np.zeros((6, len(q)))
        coefficients[0] = q
        return cls(coefficients, duration=0.0)

    @classmethod
    def between(cls, start: JointMotion, end: JointMotion, duration: float) -> Swing:
        """Makes a motion from `start` to `end` in `duration` [s]."""
        t = duration
        # difference at the end to a continued start motion
        gap = end.q - (start.q + t * start.dq + 0.5 * t * t * start.ddq)
        gap_dq = t * (end.dq - start.dq - t * start.ddq)
        gap_ddq = t * t * (end.ddq - start.ddq)
        return cls(
            np.array(
                [
                    start.q,
                    start.dq,
                    0.5 * start.ddq,
                    (10.0 * gap - 4.0 * gap_dq + 0.5 * gap_ddq) / t**3,
                    (-15.0 * gap + 7.0 * gap_dq - gap_ddq) / t**4,
                    (6.0 * gap - 3.0 * gap_dq + 0.5 * gap_ddq) / t**5,
                ]
            ),
            duration,
        )

    def later(self, time: float) -> Swing:
        """Returns the motion as seen `time` [s] later."""
        return replace(self, gone=self.gone + time)

    def at(self, time: float) -> JointMotion:
        """Returns angles, speeds and accelerations in `time` [s] from now."""
        time += self.gone
        t = min(time, self.duration)
        c = self.coefficients
        q = c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * (c[4] + t * c[5]))))
        dq = c[1] + t * (2 * c[2] + t * (3 * c[3] + t * (4 * c[4] + t * 5 * c[5])))
        if time > self.duration:
            return JointMotion(q + (time - self.duration) * dq, dq, np.zeros_like(q))
        ddq = 2 * c[2] + t * (6 * c[3] + t * (12 * c[4] + t * 20 * c[5]))
        return JointMotion(q, dq, ddq)
