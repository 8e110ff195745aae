"""The arms of a vector environment: eight pressures each in, rows of joint angles out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import o80

from ..world.arm import JOINTS
from ..world.timing import ITERATIONS
from .pressure_range import PressureRange
from .row_words import words, words_of

FloatArray = NDArray[np.float64]
Index = slice | NDArray[np.intp]

TIMEOUT = 60.0
"""Longest wait for a burst of all copies [s]."""


class Arms:
    """A group of N arms, and the last five rows of each; what `Arm` is for one.

    Views that each step fills: `motion` (N, 4, 5, 2), angle and velocity of a joint after the
    other; of the last row `last_motion` (N, 8), q then dq, and `last_racket` (N, 3) [m].
    """

    def __init__(self, group: o80.InlineGroup, *, delay: int) -> None:
        self.group = group
        self.range = PressureRange.of(group[0])
        """Of the raw pressures."""
        self._burst = group.prepared_burst(ITERATIONS, mode="overwrite", delay=delay)
        self._raw: FloatArray = self._burst.targets[:, 0]
        dtype = self._burst.rows.dtype
        row_words = words_of(self._burst.rows)
        self._last_words = row_words[:, -1]
        numbers = row_words.view(np.float64)
        q = words(dtype, "extended", "joint_positions")
        dq = words(dtype, "extended", "joint_velocities")
        assert q.stop == dq.start, "angles and velocities of the joints lie side by side"
        motion = numbers[:, :, q.start : dq.stop]
        pairs = motion.reshape(group.copies, ITERATIONS, 2, JOINTS)
        assert np.shares_memory(pairs, motion)
        self.motion = pairs.transpose(0, 3, 1, 2)
        self.last_motion = motion[:, -1]
        self.last_racket = numbers[:, -1, words(dtype, "extended", "racket_position")]
        self._last_pressures = numbers[:, -1, words(dtype, "observed")]
        self._last_asked = numbers[:, -1, words(dtype, "desired")]

    @property
    def pressures(self) -> FloatArray:
        """Normalised pressures (N, 8) in the muscles in the last rows, a fresh array."""
        return self.range.normalised(self._last_pressures)

    def asked(self, copies: Index) -> FloatArray:
        """Normalised pressures (n, 8) asked for in the last rows, a fresh array."""
        return self.range.normalised(self._last_asked[copies])

    def step(self, pressures: FloatArray, copies: Index) -> None:
        """Asks these arms for normalised pressures (n, 8), and makes five rows of each."""
        if isinstance(copies, slice):
            self.range.raw(pressures, out=self._raw)
        else:
            self._raw[copies] = self.range.raw(pressures)
        self._burst.run(copies, timeout=TIMEOUT)

    def reset(self, copies: NDArray[np.intp], seeds: list[int]) -> None:
        """These to the start."""
        self.group.request("reset", copies=copies, seed=seeds)
        self._last_words[copies] = words_of(self.group.latest(copies))
