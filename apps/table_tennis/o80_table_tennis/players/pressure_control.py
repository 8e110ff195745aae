"""Computes pressures for torques: the inverse of the muscles' force law and lag."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from o80.base.arrays import FloatArray

from ..task.actions import COARSE, changed_pressures
from ..world.arm import JOINTS, MUSCLES

PerJoint = float | tuple[float, ...]
PerMuscle = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class MusclePair:
    """Two antagonistic muscles on a pulley, with force linear in activation and in length.

    Numbers hold for all joints, tuples for each joint. The defaults are of the standard
    arm, where activation equals normalised pressure.
    """

    pulley: float = 0.037
    """[m]"""
    maximum_force: PerJoint = 1500.0
    """Force at full activation without contraction [N]."""
    stroke: PerJoint = 0.10
    """Contraction at which the force is zero [m]."""
    contracted: float = 0.02
    """Contraction of both at equal lengths [m]."""
    neutral: PerJoint = 0.0
    """Angle of equal lengths [rad]."""
    directions: PerJoint = 1.0
    """Sign of the agonist's rotation: 1 towards larger angles, -1 towards smaller ones."""
    least: PerMuscle = ((0.0, 0.0),) * JOINTS
    """Activation (4, 2) at the least pressure."""
    most: PerMuscle = ((1.0, 1.0),) * JOINTS
    """Activation (4, 2) at the largest pressure."""

    def pressures(self, torque: FloatArray, q: FloatArray, mean: float) -> FloatArray:
        """Normalised pressures (4, 2) of agonists and antagonists for torques (4,) at q (4,).

        `mean`, the mean pressure of a pair, sets the stiffness; if a muscle reaches a limit of its
        range, the other one produces the torque.
        """
        agonist, antagonist = self._lengths(q)
        share = np.asarray(self.directions) * torque / (self.pulley * self._force)
        low, high = np.array(self.least), np.array(self.most)
        middle = (low + mean * (high - low)).mean(axis=1)
        difference = (share - middle * (agonist - antagonist)) / (agonist + antagonist)

        one = np.clip(middle + difference, low[:, 0], high[:, 0])
        other = np.clip((one * agonist - share) / antagonist, low[:, 1], high[:, 1])
        one = np.clip((share + other * antagonist) / agonist, low[:, 0], high[:, 0])
        activations = np.stack([one, other], axis=1)
        result: FloatArray = (activations - low) / (high - low)
        return result

    def torque(self, pressures: FloatArray, q: FloatArray) -> FloatArray:
        """Computes torques (4,) [Nm] from normalised pressures (8,) at q (4,)."""
        low, high = np.array(self.least), np.array(self.most)
        activations = low + pressures.reshape(JOINTS, 2) * (high - low)
        agonist, antagonist = self._lengths(q)
        pull = activations[:, 0] * agonist - activations[:, 1] * antagonist
        result: FloatArray = np.asarray(self.directions) * (self.pulley * self._force) * pull
        return result

    @property
    def _force(self) -> FloatArray:
        return np.asarray(self.maximum_force, dtype=np.float64)

    def _lengths(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Relative force (4,) of agonists, and of antagonists, at full activation."""
        stroke = np.asarray(self.stroke, dtype=np.float64)
        at_zero = 1.0 - self.contracted / stroke
        change = self.pulley / stroke * np.asarray(self.directions) * (q - np.asarray(self.neutral))
        return at_zero - change, at_zero + change


@dataclass(frozen=True)
class PressureLag:
    """First-order lag of the muscles' pressures behind the commanded ones."""

    times: tuple[float, ...] = (0.016, 0.016, 0.044, 0.044, 0.044, 0.044, 0.044, 0.044)
    """Time constants (8,) [s]."""

    def after(self, pressures: FloatArray, commanded: FloatArray, duration: float) -> FloatArray:
        """Computes the muscles' pressures (8,) after `duration` [s] of `commanded` (8,)."""
        return commanded + (pressures - commanded) * np.exp(-duration / np.array(self.times))

    def asking(self, pressures: FloatArray, wanted: FloatArray, duration: float) -> FloatArray:
        """Computes commands (8,) that give `wanted` (8,) in the muscles after `duration` [s]."""
        return pressures + (wanted - pressures) / -np.expm1(-duration / np.array(self.times))


class PressureActions:
    """Converts target pressures to actions, and tracks the commanded pressures."""

    def __init__(self, *, factor: float = COARSE) -> None:
        self._factor = factor
        self.commanded = np.full(MUSCLES, 0.5)

    def start(self, pressures: FloatArray) -> None:
        """Begins an episode: the arm rests, and `pressures` (8,) equal the commanded ones."""
        self.commanded = np.clip(pressures, 0.0, 1.0)

    def towards(self, wanted: FloatArray) -> NDArray[np.float32]:
        """Computes the action (8,) in [-1, 1] that moves the commands nearest to `wanted` (8,)."""
        delta = np.clip(np.clip(wanted, 0.0, 1.0) - self.commanded, -0.49, 0.49)
        unclamped = 2.0 * np.arctanh(2.0 * delta) / self._factor
        action: NDArray[np.float32] = np.clip(unclamped, -1.0, 1.0).astype(np.float32)
        taken = action.astype(np.float64)
        self.commanded = changed_pressures(self.commanded, taken, factor=self._factor)
        return action
