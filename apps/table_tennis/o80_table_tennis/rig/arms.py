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


class Arms:
    """A group of N arms, and the last five rows of each; what `Arm` is for one.

    Views of the last row that each step fills: `last_motion` (N, 8), q then dq, and `last_racket`
    (N, 3) [m].
    """

    def __init__(self, group: o80.InlineGroup, *, delay: int) -> None:
        self.group = group
        self.range = PressureRange.of(group[0])
        """Range of the raw pressures."""
        self.burst = group.prepared_burst(ITERATIONS, mode="overwrite", delay=delay)
        """Burst of a step."""
        self._reset = group.prepared_request("reset", seed=0)
        self._reset_words = words_of(self._reset.rows)
        self._raw: FloatArray = self.burst.targets[:, 0]
        dtype = self.burst.rows.dtype
        row_words = words_of(self.burst.rows)
        self._last_words = row_words[:, -1]
        numbers = row_words.view(np.float64)
        q = words(dtype, "extended", "joint_positions")
        dq = words(dtype, "extended", "joint_velocities")
        assert q.stop == dq.start, "angles and velocities of the joints lie side by side"
        self.last_motion = numbers[:, -1, q.start : dq.stop]
        self.last_racket = numbers[:, -1, words(dtype, "extended", "racket_position")]
        self._last_pressures = numbers[:, -1, words(dtype, "observed")]
        self._last_asked = numbers[:, -1, words(dtype, "desired")]

    def read_pressures(self, out: FloatArray) -> None:
        """Fills in the normalised pressures (N, 8) in the muscles in the last rows."""
        self.range.normalised(self._last_pressures, out=out)

    def asked(self, copies: Index) -> FloatArray:
        """Normalised pressures (n, 8) asked for in the last rows, a fresh array."""
        return self.range.normalised(self._last_asked[copies])

    def ask(self, pressures: FloatArray, copies: Index) -> None:
        """Fills the targets of these arms with normalised pressures (n, 8)."""
        if isinstance(copies, slice):
            self.range.raw(pressures, out=self._raw)
        else:
            self._raw[copies] = self.range.raw(pressures)

    def gather(self, low: NDArray[np.float32], high: NDArray[np.float32]) -> NDArray[np.float32]:
        """(N, 16) angles and velocities of the joints, then normalised pressures, within bounds;
        from now on each step and reset fills them in.
        """
        names = [actuator.name for actuator in self.group[0].actuators]
        paths = [
            *(f"extended.joint_positions[{joint}]" for joint in range(JOINTS)),
            *(f"extended.joint_velocities[{joint}]" for joint in range(JOINTS)),
            *(f"observed.{name}" for name in names),
        ]
        offsets = [*[0.0] * (2 * JOINTS), *self.range.least.tolist()]
        scales = [*[1.0] * (2 * JOINTS), *self.range.scale.tolist()]
        clips = zip(low.tolist(), high.tolist(), strict=True)
        numbers = map(o80.Gathered, paths, offsets, scales, clips)
        return self.group.gather(list(numbers)).observations

    def reset(self, copies: NDArray[np.intp], seeds: list[int]) -> None:
        """These to the start."""
        self._reset.fields["seed"][copies] = seeds
        self._reset.run(copies)
        self._last_words[copies] = self._reset_words[copies]
