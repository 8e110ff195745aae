"""Pressures for wanted torques: the inverse of the muscles' law and of their lag."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..task.actions import COARSE, changed_pressures
from ..world.arm import MUSCLES

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class MusclePair:
    """Two muscles against each other on one pulley: force linear in pressure and in length."""

    pulley: float = 0.037
    """[m]"""
    maximum_force: float = 1500.0
    """[N], full pressure, not contracted."""
    stroke: float = 0.10
    """Contraction without any force [m]."""
    contracted: float = 0.02
    """Contraction of both when the joint is at zero [m]."""

    def pressures(self, torque: FloatArray, q: FloatArray, mean: float) -> FloatArray:
        """Normalised pressures (4, 2) in agonists and antagonists for torques (4,) at q (4,).

        `mean` is that of both muscles and sets the stiffness; it is raised where a pressure would
        become negative.
        """
        at_zero = 1.0 - self.contracted / self.stroke
        change = self.pulley / self.stroke * q
        agonist, antagonist = at_zero - change, at_zero + change
        share = torque / (self.pulley * self.maximum_force)
        difference = (share + 2.0 * mean * change) / at_zero / 2.0
        pressures = np.stack([mean + difference, mean - difference], axis=1)
        # one end reached: the other muscle alone makes the torque
        slack_antagonist = pressures[:, 1] < 0.0
        slack_agonist = pressures[:, 0] < 0.0
        pressures[slack_antagonist, 0] = (share / agonist)[slack_antagonist]
        pressures[slack_agonist, 1] = (-share / antagonist)[slack_agonist]
        return np.clip(pressures, 0.0, 1.0)


@dataclass(frozen=True)
class PressureLag:
    """How the pressures in the muscles follow those asked for."""

    times: tuple[float, ...] = (0.016, 0.016, 0.044, 0.044, 0.044, 0.044, 0.044, 0.044)
    """(8,) of a first-order lag [s]"""

    def after(self, pressures: FloatArray, asked: FloatArray, duration: float) -> FloatArray:
        """Pressures (8,) in the muscles after `duration` [s] of `asked` (8,)."""
        return asked + (pressures - asked) * np.exp(-duration / np.array(self.times))

    def asking(self, pressures: FloatArray, wanted: FloatArray, duration: float) -> FloatArray:
        """Pressures to ask for (8,) to have `wanted` (8,) in the muscles after `duration` [s]."""
        return pressures + (wanted - pressures) / -np.expm1(-duration / np.array(self.times))


class PressureActions:
    """Turns wanted pressures into actions, and keeps track of the pressures asked for."""

    def __init__(self, *, factor: float = COARSE) -> None:
        self._factor = factor
        self.asked = np.full(MUSCLES, 0.5)

    def start(self, pressures: FloatArray) -> None:
        """A new episode: the arm rests, the pressures in its muscles (8,) are those asked for."""
        self.asked = np.clip(pressures, 0.0, 1.0)

    def towards(self, wanted: FloatArray) -> NDArray[np.float32]:
        """The action (8,) in [-1, 1] that brings the asked pressures nearest to `wanted` (8,)."""
        delta = np.clip(np.clip(wanted, 0.0, 1.0) - self.asked, -0.49, 0.49)
        wished = 2.0 * np.arctanh(2.0 * delta) / self._factor
        action: NDArray[np.float32] = np.clip(wished, -1.0, 1.0).astype(np.float32)
        taken = action.astype(np.float64)
        self.asked = changed_pressures(self.asked, taken, factor=self._factor)
        return action
