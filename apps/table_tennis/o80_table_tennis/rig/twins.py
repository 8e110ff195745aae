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
from .arms import TIMEOUT
from .ball_records import RECORDS, BallRecords, fly_out_fields
from .row_words import words, words_of
from .twin import BALL_STATE, SEEN_NUMBERS

FloatArray = NDArray[np.float64]


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
        """Of a step: it mirrors the rows of the arms."""
        states = self.burst.targets.swapaxes(1, 2).view(np.float64)
        self._motion = states.reshape(group.copies, JOINTS, ITERATIONS, 2)
        assert np.shares_memory(self._motion, states)
        self._first = group.prepared_burst(1, self._joint_names)
        self._last_words = words_of(self.burst.rows)[:, -1]
        self._first_words = words_of(self._first.rows)
        dtype = self.burst.rows.dtype
        numbers = self._last_words.view(np.float64)
        ball = words(dtype, "observed", "balls").start
        self.ball: FloatArray = numbers[:, ball : ball + SEEN_NUMBERS]
        self.joint_positions: FloatArray = numbers[:, words(dtype, "observed", "joints")][:, ::2]
        self._records = BallRecords(self.burst.rows[:, -1][RECORDS[0]][RECORDS[1]][:, 0])

    @property
    def records(self) -> BallRecord:
        """What has happened to each ball (N,) until the last rows."""
        return self._records.read()

    def fly_out(self, copies: NDArray[np.intp], every: int, passed_y: float) -> None:
        """Their balls fly to the end of their flights, see `fly_out_fields`, in one iteration."""
        fields = fly_out_fields(every=every, passed_y=passed_y)
        self.group.request("fly_out", copies=copies, **fields)
        targets, motion = self._first.targets[:, 0], self._motion[copies, :, -1]
        targets["position"][copies], targets["velocity"][copies] = motion[..., 0], motion[..., 1]
        self._first.run(copies, timeout=TIMEOUT)
        self._last_words[copies] = self._first_words[copies, 0]

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
        self.group.request("reset", copies=copies, seed=seeds)
        targets = self._first.targets[:, 0]
        targets["position"][copies], targets["velocity"][copies] = np.hsplit(motion, 2)
        for copy, flight in zip(copies.tolist(), flights, strict=True):
            if flight is not None:
                frontend = self.group[copy]
                frontend.add_trajectory(flight.states.view(BALL_STATE)[:, 0], self._ball_name)
                frontend.pulse()
        self._first.run(copies, timeout=TIMEOUT)
        self._last_words[copies] = self._first_words[copies, 0]
