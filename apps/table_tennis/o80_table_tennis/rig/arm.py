"""The arm as the environment sees it: eight pressures in, rows of joint angles out.

A step runs thousands of times a second in an accelerated environment: a prepared burst takes the
pressures from memory and puts the rows there.
"""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

import o80

from ..world.arm import JOINTS, MUSCLES
from ..world.timing import ITERATIONS
from .pressure_range import PressureRange
from .row_words import words

FloatArray = NDArray[np.float64]

TIMEOUT = 5.0
"""Longest wait for a row [s]."""
RETURN_SECONDS = 0.6
"""Duration of the return to the start pressures [s]."""
SETTLED_SPEED = 0.02
"""Below this speed of every joint the arm stands [rad/s]."""
SETTLED_ANGLE = 0.05
"""The arm is back where it started when every joint is this near [rad]."""
LONGEST_RETURN = 4.0
"""After this the episode begins from wherever the arm stands [s]."""


class Arm:
    """A frontend to the arm, and its last five rows.

    Views that each step fills: `q`, `dq` (5, 4) [rad], [rad/s], both as `motion` (4, 5, 2), a joint
    after the other; of the last row `last_motion` (8,), q then dq, and `last_racket` (3,) [m].
    """

    def __init__(self, frontend: o80.Frontend) -> None:
        self.frontend = frontend
        self.range = PressureRange.of(frontend)
        """Range of the raw pressures."""
        self.late = False
        """The last step's pressures were taken later than at their iteration, or not yet."""
        self._sent: o80.Batch | None = None
        self._burst = None
        if frontend.bursting:
            self._burst = frontend.prepared_burst(ITERATIONS, mode="overwrite")
            self._rows = self._burst.rows
            self._pressures: FloatArray = self._burst.targets[0]
        else:
            self._rows = np.zeros(ITERATIONS, frontend.history(1).rows.dtype)
            self._pressures = np.zeros(MUSCLES)
        self._at = 0
        self._view_rows()
        self.start_pressures = np.array(frontend.latest().desired)
        self.start_angles = np.array(frontend.latest().extended.joint_positions)
        assert self.start_pressures.shape == (MUSCLES,)
        assert self.start_angles.shape == (JOINTS,)

    def _view_rows(self) -> None:
        """Names the numbers of the rows."""
        dtype = self._rows.dtype
        numbers = self._rows.view(np.float64).reshape(ITERATIONS, -1)
        self.iterations: NDArray[np.int64] = self._rows["iteration"]
        q = words(dtype, "extended", "joint_positions")
        dq = words(dtype, "extended", "joint_velocities")
        assert q.stop == dq.start, "angles and velocities of the joints lie side by side"
        self.q, self.dq = numbers[:, q], numbers[:, dq]
        motion = numbers[:, q.start : dq.stop]
        self.motion = motion.reshape(ITERATIONS, 2, JOINTS).transpose(2, 0, 1)
        self.last_motion = motion[-1]
        self.last_racket = numbers[-1, words(dtype, "extended", "racket_position")]
        self._last_pressures = numbers[-1, words(dtype, "observed")]
        self._last_asked = numbers[-1, words(dtype, "desired")]

    @property
    def newest(self) -> int:
        """Iteration of the newest row."""
        return self.frontend.published

    @property
    def last_time(self) -> int:
        """Time of the last row [ns]."""
        return int(self._rows["time"][-1])

    @property
    def pressures(self) -> FloatArray:
        """Normalised pressures (8,) in the muscles in the last row, a fresh array."""
        return self.range.normalised(self._last_pressures)

    @property
    def asked(self) -> FloatArray:
        """Normalised pressures (8,) asked for in the last row, a fresh array."""
        return self.range.normalised(self._last_asked)

    def ask(self, pressures: FloatArray, at: int) -> None:
        """Asks for normalised pressures (8,) from iteration `at` on, or at once if it has begun.

        By the clock they are sent now; an arm that bursts gets them with its `step`.
        """
        self.range.raw(pressures, out=self._pressures)
        self._at = at
        if self._burst is None:
            self.frontend.add_trajectory(self._pressures[np.newaxis], mode="overwrite")
            self._sent = self.frontend.pulse(at=at, late="now")

    def step(self, first: int) -> bool:
        """Makes the five rows from `first` on, or waits for them, and reads them.

        Returns whether they were exactly these five.
        """
        last = first + ITERATIONS - 1
        if self._burst is not None:
            return self._burst.run(TIMEOUT, at=self._at, late="now") == last
        self.frontend.wait_for(last, timeout=TIMEOUT)
        rows = self.frontend.history(since=first, until=last).rows
        self._rows[: len(rows)] = rows
        sent = self._sent
        self.late = sent is not None and (not sent.taken or sent.first_iteration > self._at)
        return len(rows) == ITERATIONS

    def reset(self, seed: int) -> None:
        """To the start, at once: a simulated arm can."""
        self.frontend.request("reset", seed=seed)

    def go_back(self) -> None:
        """To the start by commands, as a real arm must."""
        self.begin_return().wait(timeout=RETURN_SECONDS + TIMEOUT)
        end = time.monotonic() + LONGEST_RETURN
        while time.monotonic() < end:
            newest = self.read_newest()
            if self.is_back:
                break
            self.frontend.wait_for(newest + 10 * ITERATIONS, timeout=TIMEOUT)

    def begin_return(self) -> o80.Batch:
        """Sends the pressures back to those of the start, and does not wait."""
        self.frontend.add_command(
            None, self.start_pressures, duration=RETURN_SECONDS, mode="overwrite"
        )
        return self.frontend.pulse()

    @property
    def is_back(self) -> bool:
        """In the last row that was read the arm stands where it started, and is asked to."""
        asked = bool(np.array_equal(self._last_asked, self.start_pressures))
        still = float(np.abs(self.dq[-1]).max()) < SETTLED_SPEED
        return (
            asked and still and float(np.abs(self.q[-1] - self.start_angles).max()) < SETTLED_ANGLE
        )

    def read_newest(self) -> int:
        """Reads the last rows; returns the iteration of the newest one."""
        rows = self.frontend.history(ITERATIONS).rows
        self._rows[ITERATIONS - len(rows) :] = rows
        return int(self.iterations[-1])
