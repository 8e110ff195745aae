"""The twins of a vector environment: each mirrors an arm, and holds one ball."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

import o80

from ..balls.sampled_flight import SampledFlight
from ..task.ball_record import BallRecord
from ..world.arm import JOINT_NAMES, JOINTS
from ..world.timing import ITERATIONS
from .ball_records import RECORDS, BallRecords, event_flags, fly_out_fields
from .row_words import WORD, words, words_of
from .twin import BALL_STATE, SEEN_NUMBERS

FloatArray = NDArray[np.float64]

WORDS_OF_JOINTS = 2 * JOINTS
"""Angle and velocity of each, in the targets of an iteration."""


class Twins:
    """A group of N simulations of arm, table and a ball, and their last rows; N times `Twin`.

    Views that each step fills: `ball` (N, 6) position and velocity, `joint_positions` (N, 4) [rad].
    """

    def __init__(self, group: o80.InlineGroup) -> None:
        self.group = group
        names = [actuator.name for actuator in group[0].actuators]
        self._joint_names, self._ball_name = names[:JOINTS], names[JOINTS]
        assert tuple(self._joint_names) == JOINT_NAMES, "the twin moves the joints of the scene"
        self.burst = group.prepared_burst(ITERATIONS, self._joint_names, steps=ITERATIONS)
        """Burst of a step: it mirrors the rows of the arms."""
        states = self.burst.targets.swapaxes(1, 2).view(np.float64)
        self._motion = states.reshape(group.copies, JOINTS, ITERATIONS, 2)
        assert np.shares_memory(self._motion, states)
        self._reset = group.prepared_request("reset", seed=0)
        self._first = _OneRow(group.prepared_burst(1, self._joint_names))
        self._launch = _OneRow(group.prepared_burst(1, names[: JOINTS + 1]))
        self._last_words = words_of(self.burst.rows)[:, -1]
        dtype = self.burst.rows.dtype
        numbers = self._last_words.view(np.float64)
        ball = words(dtype, "observed", "balls").start
        self.ball: FloatArray = numbers[:, ball : ball + SEEN_NUMBERS]
        self.joint_positions: FloatArray = numbers[:, words(dtype, "observed", "joints")][:, ::2]
        self._gather([])

    def _gather(self, numbers: list[o80.Gathered]) -> NDArray[np.float32]:
        """Reads these numbers, and what happens to the balls, from now on in each step."""
        seen = self.group.gather(numbers, event_flags())
        flags = {name: seen[name] for name in seen.flag_names}
        self._records = BallRecords(self.burst.rows[:, -1][RECORDS[0]][RECORDS[1]][:, 0], flags)
        return seen.observations

    def gather(self, low: NDArray[np.float32], high: NDArray[np.float32]) -> NDArray[np.float32]:
        """(N, 6) position and velocity of each ball, within bounds; from now on each step and
        reset fills them in.
        """
        ball = f"observed.{self._ball_name}"
        paths = [f"{ball}.{part}[{axis}]" for part in ("position", "velocity") for axis in range(3)]
        clips = zip(low.tolist(), high.tolist(), strict=True)
        numbers = [o80.Gathered(path, clip=clip) for path, clip in zip(paths, clips, strict=True)]
        return self._gather(numbers)

    @property
    def records(self) -> BallRecord:
        """Records of what has happened to each ball (N,) until the last rows."""
        return self._records.read()

    def fly_out(self, copies: NDArray[np.intp], every: int, passed_y: float) -> None:
        """Their balls fly to the end of their flights, see `fly_out_fields`, in one iteration."""
        fields = fly_out_fields(every=every, passed_y=passed_y)
        self.group.request("fly_out", copies=copies, **fields)
        motion = self._motion[copies, :, -1]
        self._move(self._first, copies, motion[..., 0], motion[..., 1])

    def reset(
        self,
        copies: NDArray[np.intp],
        seeds: list[int],
        motion: FloatArray,
        flights: Sequence[SampledFlight | None],
    ) -> None:
        """These to the start, where their arms (n, 8) stand; their balls fly from the next step on.

        Without a flight the ball falls from where the scene puts it.
        """
        self._reset.fields["seed"][copies] = seeds
        self._reset.run(copies)
        if all(flight is not None and len(flight.positions) == 1 for flight in flights):
            # the usual case: no command, so that nothing of it is queued
            balls = [flight.states[0] for flight in flights if flight is not None]
            self._launch.numbers[copies, WORDS_OF_JOINTS:] = balls
            self._move(self._launch, copies, motion[:, :JOINTS], motion[:, JOINTS:])
            return
        for copy, flight in zip(copies.tolist(), flights, strict=True):
            if flight is not None:
                frontend = self.group[copy]
                frontend.add_trajectory(flight.states.view(BALL_STATE)[:, 0], self._ball_name)
                frontend.pulse()
        self._move(self._first, copies, motion[:, :JOINTS], motion[:, JOINTS:])

    def _move(
        self, burst: _OneRow, copies: NDArray[np.intp], angles: FloatArray, velocities: FloatArray
    ) -> None:
        """One iteration, with the joints there."""
        burst.numbers[copies, 0:WORDS_OF_JOINTS:2] = angles
        burst.numbers[copies, 1:WORDS_OF_JOINTS:2] = velocities
        burst.burst.run(copies)
        self._last_words[copies] = burst.words[copies, 0]


class _OneRow:
    """A burst of one iteration, whose targets are read as numbers."""

    def __init__(self, burst: o80.GroupBurst) -> None:
        self.burst = burst
        copies = len(burst.targets)
        self.numbers: FloatArray = np.ndarray(
            (copies, burst.targets.nbytes // copies // WORD), np.float64, burst.targets
        )
        """(N, 8 or more) angle and velocity of each joint, then the ball, if it moves."""
        self.words = words_of(burst.rows)
