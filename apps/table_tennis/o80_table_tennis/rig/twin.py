"""A twin as the environment sees it: it mirrors the arm, and holds balls.

`Twin` is one twin with a frontend and any number of balls, `Twins` are the twins of a vector
environment, with one ball each; both show their last rows alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import o80
from o80.base.arrays import FloatArray
from o80.rows.layout import field_view, with_padding

from ..balls.sampled_flight import SampledFlight
from ..task.ball_record import BallRecord
from ..world.arm import JOINT_NAMES, JOINTS
from ..world.timing import ITERATIONS
from .ball_records import BallRecords, ball_records, event_flags, fly_out_fields, records_of

Flights = Sequence[SampledFlight]
"""Flights of the balls of a copy, the played one first; empty: they fall from their places."""

TIMEOUT = 5.0
"""Longest wait for a burst [s]."""
BALL_STATE = np.dtype([(name, np.float64, (3,)) for name in ("position", "velocity", "spin")])
BALL_NUMBERS = 9
SEEN_NUMBERS = 6
"""Position and velocity: what is observed of a ball."""
WORDS_OF_JOINTS = 2 * JOINTS
"""Angle and velocity of each, in the targets of an iteration."""


class TwinRows:
    """The last rows (N,) of N twins, and the names of what they move.

    Views that each step fills: `all_balls` (N, balls, 6) position [m] and velocity [m/s], `ball`
    (N, 6) of the first one, `joint_positions` (N, 4) [rad].
    """

    def __init__(self, last: NDArray[Any], actuators: Sequence[o80.Actuator]) -> None:
        states = field_view(last, "observed.balls")
        balls = states.reshape(len(last), -1, BALL_NUMBERS)
        assert np.shares_memory(balls, last)
        self.all_balls: FloatArray = balls[..., :SEEN_NUMBERS]
        self.ball: FloatArray = self.all_balls[:, 0]
        self.joint_positions: FloatArray = last["observed"]["joints"]["position"]
        names = [actuator.name for actuator in actuators]
        self.joint_names, self.ball_names = names[:JOINTS], names[JOINTS:]
        assert tuple(self.joint_names) == JOINT_NAMES, "the twin moves the joints of the scene"


class Twin(TwinRows):
    """A frontend to one simulation of the arm, the table and balls, the last `extra` extra ones."""

    def __init__(self, frontend: o80.Frontend, *, extra: int = 0) -> None:
        self.frontend = frontend
        names = [actuator.name for actuator in frontend.actuators[:JOINTS]]
        self._burst = frontend.prepared_burst(ITERATIONS, names, steps=ITERATIONS)
        last = self._burst.rows[-1:]
        super().__init__(last, frontend.actuators)
        self.balls = len(self.ball_names)
        """How many there are."""
        self.extra = slice(self.balls - extra, self.balls)
        """The extra balls; a twin that has no other one holds the played ball too."""
        self.all_records: NDArray[Any] = records_of(last)[0]
        """The records (balls,) in the newest row, as the simulator has them; a view."""
        self._motion = self._burst.targets.T.view(np.float64).reshape(JOINTS, ITERATIONS, 2)
        self._last = last.view(np.uint8)
        self.iteration = -1
        """Iteration of the newest row."""

    def reset(self, seed: int) -> None:
        """All balls and contacts forgotten."""
        self.frontend.request("reset", seed=seed)

    def begin(self, motion: FloatArray, flights: Flights) -> None:
        """Adds the arm (8,) as it stands and the whole flight of each ball, for the next burst.

        Without any flight the balls fall from where the scene puts them.
        """
        targets = {"position": motion[None, :JOINTS], "velocity": motion[None, JOINTS:]}
        self.frontend.add_trajectory(targets, self.joint_names)
        for ball, flight in zip(self.ball_names, flights, strict=bool(flights)):
            self.frontend.add_trajectory(flight.states.view(BALL_STATE)[:, 0], ball)

    def step(self, motion: FloatArray, seen: o80.Seen | None) -> None:
        """Mirrors angle and velocity of each joint in the arm's last rows (4, 5, 2).

        seen: the last of these rows, for those who join the rows of arm and twin.
        """
        self._motion[...] = motion
        self.iteration = self._burst.run(TIMEOUT, seen=seen)

    def mirror(self, motion: FloatArray) -> None:
        """Adds the same, to be burst together with other twins."""
        self._motion[...] = motion
        self.frontend.add_trajectory(self._burst.targets, self.joint_names)

    def fly_out(self, _copies: object, every: int, passed_y: float) -> None:
        """The first ball flies to the end of its flight, see `fly_out_fields`, in one iteration."""
        self.frontend.request("fly_out", **fly_out_fields(every=every, passed_y=passed_y))
        self.see(self.frontend.burst(1, timeout=TIMEOUT))

    def see(self, row: o80.Observation) -> None:
        """The newest row is this one."""
        memory: Any = row
        self._last[...], self.iteration = np.frombuffer(memory, np.uint8), row.iteration

    @property
    def records(self) -> BallRecord:
        """Record (1,) of what has happened to the first ball until the newest row."""
        return ball_records(self.all_records[:1])


class Twins(TwinRows):
    """A group of N simulations of arm, table and one ball."""

    def __init__(self, group: o80.InlineGroup) -> None:
        self.group = group
        names = [actuator.name for actuator in group[0].actuators]
        joints = names[:JOINTS]
        self.burst = group.prepared_burst(ITERATIONS, joints, steps=ITERATIONS)
        """Burst of a step: it mirrors the rows of the arms."""
        last = self.burst.rows[:, -1]
        super().__init__(last, group[0].actuators)
        states = self.burst.targets.swapaxes(1, 2).view(np.float64)
        self._motion = states.reshape(group.copies, JOINTS, ITERATIONS, 2)
        assert np.shares_memory(self._motion, states)
        self._reset = group.prepared_request("reset", seed=0)
        self._first = _OneRow(group.prepared_burst(1, joints))
        self._launch = _OneRow(group.prepared_burst(1, names[: JOINTS + 1]))
        self._last = with_padding(last)
        self._record_rows = records_of(last)[:, 0]
        self._gather([])

    def _gather(self, numbers: list[o80.Gathered]) -> NDArray[np.float32]:
        """Reads these numbers, and what happens to the balls, from now on in each step."""
        seen = self.group.gather(numbers, event_flags())
        self._records = BallRecords(
            self._record_rows, {name: seen[name] for name in seen.flag_names}
        )
        return seen.observations

    def gather(self, low: NDArray[np.float32], high: NDArray[np.float32]) -> NDArray[np.float32]:
        """(N, 6) position and velocity of each ball, within bounds; from now on each step and
        reset fills them in.
        """
        ball = f"observed.{self.ball_names[0]}"
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
        flights: Sequence[Flights],
    ) -> None:
        """These to the start, where their arms (n, 8) stand; their balls fly from the next step on.

        Without a flight the ball falls from where the scene puts it.
        """
        self._reset.fields["seed"][copies] = seeds
        self._reset.run(copies)
        if all(len(its) == 1 and len(its[0].positions) == 1 for its in flights):
            # the usual case: no command, so that nothing of it is queued
            self._launch.numbers[copies, WORDS_OF_JOINTS:] = [its[0].states[0] for its in flights]
            self._move(self._launch, copies, motion[:, :JOINTS], motion[:, JOINTS:])
            return
        for copy, its in zip(copies.tolist(), flights, strict=True):
            for flight in its:
                frontend = self.group[copy]
                frontend.add_trajectory(flight.states.view(BALL_STATE)[:, 0], self.ball_names[0])
                frontend.pulse()
        self._move(self._first, copies, motion[:, :JOINTS], motion[:, JOINTS:])

    def _move(
        self, burst: _OneRow, copies: NDArray[np.intp], angles: FloatArray, velocities: FloatArray
    ) -> None:
        """One iteration, with the joints there."""
        burst.numbers[copies, 0:WORDS_OF_JOINTS:2] = angles
        burst.numbers[copies, 1:WORDS_OF_JOINTS:2] = velocities
        burst.burst.run(copies)
        self._last[copies] = burst.rows[copies]


class _OneRow:
    """A burst of one iteration, whose targets are read as numbers."""

    def __init__(self, burst: o80.GroupBurst) -> None:
        self.burst = burst
        copies = len(burst.targets)
        size = burst.targets.nbytes // copies // np.dtype(np.float64).itemsize
        self.numbers: FloatArray = np.ndarray((copies, size), np.float64, burst.targets)
        """(N, 8 or more) angle and velocity of each joint, then the ball, if it moves."""
        self.rows = with_padding(burst.rows[:, 0])
