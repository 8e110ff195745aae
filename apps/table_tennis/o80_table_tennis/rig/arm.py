"""The arm as the environment sees it: eight pressures in, rows of joint angles out.

`step` runs thousands of times a second in an accelerated environment: a prepared burst takes the
pressures from memory and puts the rows there.
"""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

import o80

from ..settings import ITERATIONS, JOINTS
from ..task.actions import MUSCLES
from .row_words import words

FloatArray = NDArray[np.float64]

TIMEOUT = 5.0
"""Longest wait for a row [s]."""
RETURN_SECONDS = 0.6
"""In which the pressures go back to those of the start [s]."""
SETTLED_SPEED = 0.02
"""Below this speed of every joint the arm stands [rad/s]."""
SETTLED_ANGLE = 0.05
"""The arm is back where it started when every joint is this near [rad]."""
LONGEST_RETURN = 4.0
"""After this the episode begins from wherever the arm stands [s]."""


class Arm:
    """A frontend to the arm, and its last five rows.

    `pressures` (8,), raw, are what the next `step` asks for. Views that it fills: `q`, `dq` (5, 4)
    [rad], [rad/s], both as `motion` (4, 5, 2), a joint after the other; of the last row
    `last_motion` (8,), q then dq, and `last_pressures` (8,), raw.
    """

    def __init__(self, frontend: o80.Frontend) -> None:
        self.frontend = frontend
        self._burst = None
        if frontend.bursting:
            self._burst = frontend.prepared_burst(ITERATIONS, mode="overwrite")
            self._rows = self._burst.rows
            self.pressures: FloatArray = self._burst.targets[0]
        else:
            self._rows = np.zeros(ITERATIONS, frontend.history(1).rows.dtype)
            self.pressures = np.zeros(MUSCLES)
        self.late = False
        """The last step's pressures were taken later than at their iteration, or not yet."""
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
        self.last_pressures = numbers[-1, words(dtype, "observed")]
        self._asked = numbers[:, words(dtype, "desired")]
        self.start_pressures = np.array(frontend.latest().desired)
        self.start_angles = np.array(frontend.latest().extended.joint_positions)
        assert self.start_pressures.shape == (MUSCLES,)
        assert self.start_angles.shape == (JOINTS,)

    @property
    def newest(self) -> int:
        """Iteration of the newest row."""
        return self.frontend.published

    def step(self, first: int, at: int) -> bool:
        """Asks for `pressures` from iteration `at` on, or at once if it has begun, and lets the arm
        make the five rows from `first` on, or waits for them, and reads them.

        Returns whether they were exactly these five.
        """
        last = first + ITERATIONS - 1
        if self._burst is not None:
            return self._burst.run(TIMEOUT, at=at, late="now") == last
        self.frontend.add_trajectory(self.pressures[np.newaxis], mode="overwrite")
        sent = self.frontend.pulse(at=at, late="now")
        self.frontend.wait_for(last, timeout=TIMEOUT)
        rows = self.frontend.history(since=first, until=last).rows
        self._rows[: len(rows)] = rows
        self.late = not sent.taken or sent.first_iteration > at
        return len(rows) == ITERATIONS

    @property
    def asked(self) -> FloatArray:
        """Raw pressures (8,) asked for in the last row, a fresh array."""
        asked: FloatArray = self._asked[-1].copy()
        return asked

    def reset(self, seed: int) -> None:
        """To the start, at once: a simulated arm can."""
        self.frontend.request("reset", seed=seed)

    def go_back(self) -> None:
        """To the start by commands, as a real arm must."""
        self.frontend.add_command(
            None, self.start_pressures, duration=RETURN_SECONDS, mode="overwrite"
        )
        self.frontend.pulse_and_wait(timeout=RETURN_SECONDS + TIMEOUT)
        end = time.monotonic() + LONGEST_RETURN
        while time.monotonic() < end:
            newest = self.read_newest()
            still = float(np.abs(self.dq[-1]).max()) < SETTLED_SPEED
            back = float(np.abs(self.q[-1] - self.start_angles).max()) < SETTLED_ANGLE
            if still and back:
                break
            self.frontend.wait_for(newest + 10 * ITERATIONS, timeout=TIMEOUT)

    def read_newest(self) -> int:
        """Reads the last rows; returns the iteration of the newest one."""
        rows = self.frontend.history(ITERATIONS).rows
        self._rows[ITERATIONS - len(rows) :] = rows
        return int(self.iterations[-1])
