"""Range of each muscle's pressure, from the arm's description."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

import o80
from o80.base.arrays import FloatArray


class PressureRange:
    """Least and largest raw pressure (8,) of each muscle."""

    def __init__(self, least: Sequence[float], most: Sequence[float]) -> None:
        self.least: FloatArray = np.array(least, dtype=np.float64)
        self._span: FloatArray = np.array(most, dtype=np.float64) - self.least
        self.scale: FloatArray = 1.0 / self._span
        """(8,) factor: normalised pressures are (raw - least) * scale."""

    @classmethod
    def of(cls, frontend: o80.Frontend) -> PressureRange:
        """Reads the limits of an arm's actuators."""
        limits = [each.limits for each in frontend.actuators]
        return cls([each.minimum for each in limits], [each.maximum for each in limits])

    @property
    def most(self) -> FloatArray:
        """(8,) raw"""
        return self.least + self._span

    def raw(self, normalised: FloatArray, *, out: FloatArray | None = None) -> FloatArray:
        """Converts normalised pressures in [0, 1] to whole raw ones (..., 8); fresh, or `out`."""
        return np.rint(self.least + normalised * self._span, out)

    def normalised(self, raw: FloatArray, *, out: FloatArray | None = None) -> FloatArray:
        """Converts raw pressures to normalised ones (..., 8), not clipped; fresh, or `out`."""
        above = np.subtract(raw, self.least, out)
        return np.multiply(above, self.scale, above)
