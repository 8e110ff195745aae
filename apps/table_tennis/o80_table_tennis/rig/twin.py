"""One twin as the environment sees it: it mirrors the arm, and holds balls."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import o80

from ..balls.sampled_flight import SampledFlight
from ..task.ball_record import BallRecord
from ..world.arm import JOINT_NAMES, JOINTS
from ..world.timing import ITERATIONS
from .ball_records import RECORDS, BallReader, fly_out_fields
from .row_words import WORD, words

FloatArray = NDArray[np.float64]

TIMEOUT = 5.0
"""Longest wait for a burst [s]."""
BALL_NUMBERS = 9
"""Position, velocity and spin."""
SEEN_NUMBERS = 6
"""Position and velocity: what is observed."""
BALL_STATE = np.dtype([(name, np.float64, (3,)) for name in ("position", "velocity", "spin")])


class Twin:
    """A frontend to one simulation of the arm, the table and `balls` balls."""

    def __init__(self, frontend: o80.Frontend) -> None:
        self.frontend = frontend
        dtype = frontend.history(1).rows.dtype
        self._joints = words(dtype, "observed", "joints")
        self._balls = words(dtype, "observed", "balls")
        self.balls = (self._balls.stop - self._balls.start) // BALL_NUMBERS
        """How many there are."""
        self._first_ball = slice(self._balls.start, self._balls.start + SEEN_NUMBERS)
        self._records_at = words(dtype, *RECORDS).start * WORD
        self._record_dtype = dtype[RECORDS[0]][RECORDS[1]].base
        self._reader = BallReader(self._record_dtype, self._records_at)
        names = [actuator.name for actuator in frontend.actuators]
        self._joint_names, self._ball_names = names[:JOINTS], names[JOINTS:]
        assert tuple(self._joint_names) == JOINT_NAMES, "the twin moves the joints of the scene"
        self._burst = frontend.prepared_burst(ITERATIONS, self._joint_names, steps=ITERATIONS)
        states = self._burst.targets.T.view(np.float64)
        self._motion = states.reshape(JOINTS, ITERATIONS, 2)
        self._last = self._burst.rows.view(np.float64).reshape(ITERATIONS, -1)[-1]
        self.row: FloatArray = self._last
        """The words of the newest row; the next step overwrites them."""
        self.iteration = -1
        """Iteration of that row."""

    def reset(self, seed: int) -> None:
        """All balls and contacts forgotten."""
        self.frontend.request("reset", seed=seed)

    def begin(self, q: FloatArray, dq: FloatArray, flights: Sequence[SampledFlight]) -> None:
        """Adds the arm (4,) as it stands and the whole flight of each ball, for the next burst.

        Without any flight the balls fall from where the scene puts them.
        """
        targets = {"position": q[None, :], "velocity": dq[None, :]}
        self.frontend.add_trajectory(targets, self._joint_names)
        for ball, flight in zip(self._ball_names, flights, strict=bool(flights)):
            states = flight.states.view(BALL_STATE)[:, 0]
            self.frontend.add_trajectory(states, ball)

    def step(self, motion: FloatArray) -> None:
        """Mirrors angle and velocity of each joint in the arm's last rows (4, 5, 2)."""
        self._motion[...] = motion
        self.iteration = self._burst.run(TIMEOUT)
        self.row = self._last

    def mirror(self, motion: FloatArray) -> None:
        """Adds the same, to be burst together with other twins."""
        self._motion[...] = motion
        self.frontend.add_trajectory(self._burst.targets, self._joint_names)

    def fly_out(self, every: int, passed_y: float) -> None:
        """The first ball flies to the end of its flight, see `fly_out_fields`, in one iteration."""
        self.frontend.request("fly_out", **fly_out_fields(every=every, passed_y=passed_y))
        self.see(self.frontend.burst(1, timeout=TIMEOUT))

    def see(self, row: o80.Observation) -> None:
        """The newest row is this one."""
        memory: Any = row
        self.row, self.iteration = np.frombuffer(memory), row.iteration

    @property
    def ball(self) -> FloatArray:
        """Position and velocity (6,) of the first ball in the newest row; a view."""
        return self.row[self._first_ball]

    @property
    def all_balls(self) -> FloatArray:
        """Positions and velocities (balls, 6) in the newest row; a view."""
        return self.row[self._balls].reshape(self.balls, BALL_NUMBERS)[:, :SEEN_NUMBERS]

    @property
    def joint_positions(self) -> FloatArray:
        """(4,) [rad] in the newest row; a view."""
        return self.row[self._joints][::2]

    @property
    def record(self) -> BallRecord:
        """Record of what has happened to the first ball until the newest row."""
        return self._reader.read(self.row)

    @property
    def all_records(self) -> NDArray[Any]:
        """The records (balls,) in the newest row, as the simulator has them; a view."""
        return np.ndarray((self.balls,), self._record_dtype, self.row, self._records_at)
