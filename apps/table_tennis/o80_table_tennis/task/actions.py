"""Actions: small changes of eight muscle pressures.

The order of the muscles is that of the arm: agonist and antagonist of joint 1, of joint 2, and so
on. Normalised pressures run from 0 (the least of the muscle's range) to 1 (the most).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

MUSCLES = 8
FINE = 0.05
"""Factor of the actions in the published fine configuration."""
COARSE = 1.0
"""Factor of the actions in the published coarse configuration."""
START_PRESSURE = 18000
"""Raw pressure of every muscle at the start of a published episode."""

NOUGHT = np.zeros(MUSCLES)


@dataclass(frozen=True)
class PressureRange:
    """The least and the most raw pressure of each muscle."""

    least: tuple[int, ...]
    """(8,)"""
    most: tuple[int, ...]
    """(8,)"""

    def __post_init__(self) -> None:
        if len(self.least) != MUSCLES or len(self.most) != MUSCLES:
            raise ValueError(
                f"a pressure range needs {MUSCLES} least and {MUSCLES} most pressures, "
                f"not {len(self.least)} and {len(self.most)}"
            )
        for muscle, (least, most) in enumerate(zip(self.least, self.most, strict=True)):
            if least >= most:
                raise ValueError(f"muscle {muscle}: least pressure {least} is not below {most}")

    @classmethod
    def of_pairs(
        cls,
        agonists: tuple[Sequence[int], Sequence[int]],
        antagonists: tuple[Sequence[int], Sequence[int]],
    ) -> PressureRange:
        """From (least, most) of the four agonists and of the four antagonists."""
        return cls(
            least=tuple(_interleaved(agonists[0], antagonists[0])),
            most=tuple(_interleaved(agonists[1], antagonists[1])),
        )

    def raw(self, normalised: FloatArray) -> IntArray:
        """Raw pressures (..., 8) of normalised ones, rounded; outside of 0 to 1 is clipped."""
        least, most = np.array(self.least), np.array(self.most)
        share = np.clip(normalised, 0.0, 1.0)
        raw: IntArray = np.rint(least + share * (most - least)).astype(np.int64)
        return raw

    def normalised(self, raw: FloatArray | IntArray) -> FloatArray:
        """Normalised pressures (..., 8) of raw ones, not clipped."""
        least, most = np.array(self.least), np.array(self.most)
        share: FloatArray = (np.asarray(raw, dtype=np.float64) - least) / (most - least)
        return share


def _interleaved(agonists: Sequence[int], antagonists: Sequence[int]) -> list[int]:
    return [pressure for pair in zip(agonists, antagonists, strict=True) for pressure in pair]


SIMULATED_RANGE = PressureRange(least=(6000,) * MUSCLES, most=(24000,) * MUSCLES)
"""Of the simulated arm."""
REAL_RANGE = PressureRange.of_pairs(
    agonists=((15000, 15000, 13000, 13000), (25000, 21500, 21000, 19000)),
    antagonists=((16000, 16000, 13000, 13000), (25000, 25000, 21000, 21900)),
)
"""Of the real arm."""


def changed_pressures(
    pressures: FloatArray, action: NDArray[np.floating[Any]], *, factor: float = FINE
) -> FloatArray:
    """Normalised pressures (8,) after an action (8,) in [-1, 1]; clipped to [0, 1], a fresh array.

    delta = sigmoid(factor * action) - 1/2, as published, which is tanh(factor * action / 2) / 2.
    Raises ValueError for a wrong shape or a number that is not finite; an action outside of
    [-1, 1] is clipped.
    """
    action = np.asarray(action, dtype=np.float64)
    if action.shape != (MUSCLES,):
        raise ValueError(f"an action has shape ({MUSCLES},), not {action.shape}")
    # 0 times what is not finite is not a number
    if math.isnan(action.dot(NOUGHT)):
        raise ValueError(f"an action must be finite, not {action}")
    clipped = np.minimum(np.maximum(action, -1.0), 1.0)
    changed = pressures + 0.5 * np.tanh(0.5 * factor * clipped)
    result: FloatArray = np.minimum(np.maximum(changed, 0.0), 1.0)
    return result
