"""The arm as the environment sees it: eight pressures in, rows of joint angles out.

`Arm` is one arm with a frontend, `Arms` are the arms of a vector environment; both show their last
rows alike. A step runs thousands of times a second in an accelerated environment: a prepared burst
takes the pressures from memory and puts the rows there.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

import o80
from o80.base.arrays import FloatArray
from o80.learning import EVERY, Index
from o80.rows.layout import field_view, with_padding

from ..world.arm import JOINTS, MUSCLES
from ..world.timing import ITERATIONS
from .pressure_range import PressureRange

MOTION = ("extended.joint_positions", "extended.joint_velocities")
"""Fields of a row with the angles [rad] and velocities [rad/s] of the joints, side by side."""
TIMEOUT = 5.0
"""Longest wait for a row [s]."""
LOOK_AGAIN = 0.01
"""Time after which it looks again for what does not come with a row [s]."""
RETURN_SECONDS = 0.6
"""Duration of the return to the start pressures [s]."""
SETTLED_SPEED = 0.02
"""Below this speed of every joint the arm stands [rad/s]."""
SETTLED_ANGLE = 0.05
"""The arm is back where it started when every joint is this near [rad]."""
LONGEST_RETURN = 4.0
"""After this the episode begins from wherever the arm stands [s]."""


class ArmRows:
    """The last rows (N,) of N arms.

    Views that each step fills: `last_motion` (N, 8), angles [rad] then velocities [rad/s] of the
    joints, and `last_racket` (N, 3) [m].
    """

    def __init__(self, last: NDArray[Any], pressures: PressureRange) -> None:
        self.range = pressures
        """Range of the raw pressures."""
        self.last_motion = field_view(last, *MOTION)
        self.last_racket = field_view(last, "extended.racket_position")
        self._last_pressures, self._last_commanded = last["observed"], last["desired"]

    def read_pressures(self, out: FloatArray) -> None:
        """Fills in the normalised pressures (N, 8) in the muscles in the last rows."""
        self.range.normalised(self._last_pressures, out=out)

    def commanded(self, copies: Index = EVERY) -> FloatArray:
        """Normalised pressures (n, 8) asked for in the last rows, a fresh array."""
        return self.range.normalised(self._last_commanded[copies])


class Arm(ArmRows):
    """A frontend to one arm, and its last five rows: `motion` (4, 5, 2) of each joint."""

    def __init__(self, frontend: o80.Frontend, *, chunks: bool = False) -> None:
        """chunks: `ask` gets the rows of a chunk."""
        self.frontend = frontend
        self.late = 0
        """1 if what was asked last was taken later than at its iteration, or not yet; with chunks
        its late rows, which were skipped. Known after `settle`."""
        self.starved = 0
        """Iterations before the last chunk began for which the one before it had no row."""
        self._sent: o80.Batch | None = None
        self._plan = frontend.chunks(step=ITERATIONS, profile="hold") if chunks else None
        self._chunk: o80.SentChunk | None = None
        self._rows_asked = 0
        self._planned_until: int | None = None
        self._burst = None
        if frontend.bursting and not chunks:
            self._burst = frontend.prepared_burst(ITERATIONS, mode="overwrite")
            self._rows = self._burst.rows
            self._pressures: FloatArray = self._burst.targets
        else:
            self._rows = np.zeros(ITERATIONS, frontend.history(1).rows.dtype)
            self._pressures = np.zeros((1, MUSCLES))
        self._at = 0
        super().__init__(self._rows[-1:], PressureRange.of(frontend))
        motion = field_view(self._rows, *MOTION)
        self.motion = motion.reshape(ITERATIONS, 2, JOINTS).transpose(2, 0, 1)
        newest = frontend.latest()
        self._epoch, self._clock = newest.epoch, frontend.schema["clock"]
        self.start_pressures = np.array(newest.desired)
        self.start_angles = np.array(newest.extended.joint_positions)
        assert self.start_pressures.shape == (MUSCLES,)
        assert self.start_angles.shape == (JOINTS,)

    @property
    def newest(self) -> int:
        """Iteration of the newest row."""
        return self.frontend.published

    @property
    def seen(self) -> o80.Seen:
        """The last row that was read, for what is sent to others by it."""
        return o80.Seen(self._epoch, int(self._rows["iteration"][-1]), self.last_time, self._clock)

    @property
    def last_time(self) -> int:
        """Time of the last row [ns]."""
        return int(self._rows["time"][-1])

    def begin(self) -> None:
        """An episode begins: nothing is planned."""
        self._planned_until = None

    def ask(self, pressures: FloatArray, at: int) -> None:
        """Asks for normalised pressures (1, 8) from iteration `at` on, or at once if it has begun.

        By the clock they are sent now; an arm that bursts gets them with its `step`. With chunks
        (n, 8): row j for the five iterations from `at` + 5 j on, and in no other ones.
        """
        if self._plan is not None:
            if self._planned_until is None:
                self._planned_until = at - 1
            self._at, self._rows_asked = at, len(pressures)
            self._chunk = self._plan.send(self.range.raw(pressures), seen=at - 1, fixed=True)
            return
        self.range.raw(pressures, out=self._pressures)
        self._at = at
        if self._burst is None:
            self.frontend.add_trajectory(self._pressures, mode="overwrite")
            self._sent = self.frontend.pulse(at=at, late="now", seen=self.seen)

    def step(self, first: int) -> bool:
        """Makes the five rows from `first` on, or waits for them, and reads them.

        Returns whether they were exactly these five.
        """
        last = first + ITERATIONS - 1
        if self._burst is not None:
            return self._burst.run(TIMEOUT, at=self._at, late="now") == last
        if not self.frontend.bursting:
            self.frontend.wait_for(last, timeout=TIMEOUT)
        elif self.newest < last:
            self.frontend.burst(last - self.newest, timeout=TIMEOUT)
        rows = self.frontend.history(since=first, until=last).rows
        self._rows[: len(rows)] = rows
        return len(rows) == ITERATIONS

    def settle(self) -> None:
        """Counts what was late, after the steps of what was asked last."""
        if self._chunk is None:
            sent = self._sent
            self.late = int(
                sent is not None and (not sent.taken or sent.first_iteration > self._at)
            )
            return
        chunk, rows = self._chunk, self._rows_asked
        end = time.monotonic() + TIMEOUT
        while not chunk.decided:
            try:
                self.frontend.wait_for(self.newest + 1, timeout=LOOK_AGAIN)
            except TimeoutError:
                # a rejection is told after its row; there may be no other one
                if time.monotonic() > end:
                    raise
        self.late, self.starved = rows if chunk.late is None else chunk.late, 0
        if chunk.begins is not None and self._planned_until is not None:
            self.starved = max(0, chunk.begins - 1 - self._planned_until)
            self._planned_until = self._at - 1 + ITERATIONS * rows

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
        angles, velocities = self.last_motion[0, :JOINTS], self.last_motion[0, JOINTS:]
        commanded = np.array_equal(self._last_commanded[0], self.start_pressures)
        still = np.abs(velocities).max() < SETTLED_SPEED
        return bool(
            commanded and still and np.abs(angles - self.start_angles).max() < SETTLED_ANGLE
        )

    def read_newest(self) -> int:
        """Reads the last rows; returns the iteration of the newest one."""
        rows = self.frontend.history(ITERATIONS).rows
        self._rows[ITERATIONS - len(rows) :] = rows
        return int(self._rows["iteration"][-1])


class Arms(ArmRows):
    """A group of N arms, and the last five rows of each."""

    def __init__(self, group: o80.InlineGroup, *, delay: int) -> None:
        self.group = group
        self.burst = group.prepared_burst(ITERATIONS, mode="overwrite", delay=delay)
        """Burst of a step."""
        self._reset = group.prepared_request("reset", seed=0)
        self._raw: FloatArray = self.burst.targets[:, 0]
        last = self.burst.rows[:, -1]
        self._last, self._reset_rows = with_padding(last), with_padding(self._reset.rows)
        super().__init__(last, PressureRange.of(group[0]))

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
            *(f"{field}[{joint}]" for field in MOTION for joint in range(JOINTS)),
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
        self._last[copies] = self._reset_rows[copies]
