"""The arm and its twins: started or attached to, moved in step, and ended when left."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import count
from typing import Any

import numpy as np

import o80
from o80.base.arrays import FloatArray
from o80.base.lifecycle import Closeable
from o80.learning import EVERY

from ..settings import Pacing, RigSettings
from ..world.arm import MUSCLES
from ..world.timing import ITERATIONS
from .arm import Arm
from .robot_options import arm_options, twin_options
from .twin import TIMEOUT, Flights, Twin

NUMBERS = count(1)


def unused_name(robot: str) -> str:
    """Name of a segment that no rig of any process has."""
    return f"{robot}-{os.getpid()}-{next(NUMBERS)}"


@dataclass
class StepCounts:
    """Counts of a rig while it is moved."""

    steps: int = 0
    exact_steps: int = 0
    """Steps in which the arm and the first twin made exactly five iterations."""
    late_actions: int = 0
    """Actions that came after the iteration for which they were meant; rows of chunks that were
    skipped for that reason."""
    starved_iterations: int = 0
    """Iterations of the arm, within episodes, for which no chunk had a row."""
    summed_lateness: int = 0
    """[rows]"""
    largest_lateness: int = 0
    """[rows]"""


class Rig(Closeable):
    """One arm and the twins that mirror it, in one of three ways of pacing.

    The task moves it as it moves a `GroupRig` with one copy.

    A step is `ask`, `step_arm`, `step_twins`, with k the arm's newest row that was used, `row`: the
    pressures act from iteration k + 1 + delay; the arm makes the rows k + 1 to k + 5; the twins
    mirror them.

    While it is open, move arm and twins only through it. Closing it ends what it started.
    """

    def __init__(
        self, settings: RigSettings | None = None, *, delay: int = 1, chunks: bool = False
    ) -> None:
        """delay: iterations from the beginning of a step until its pressures act.

        chunks: a step gets the rows of a chunk.
        """
        self.settings = settings or RigSettings()
        self.row = self.twin_row = 0
        """Iterations of arm and twins that were used last."""
        self.counts = StepCounts()
        self.returns_at_reset = True
        """By the clock `reset` first brings the arm back; False: the caller has done so."""
        self.after_step: Callable[[], None] | None = None
        """Called after each step of 10 ms, with the newest rows of arm and twins."""
        self._delay = delay
        self._real_time = self.settings.pacing.real_time
        self._stack = ExitStack()
        try:
            self.arm = Arm(self._open_arm(), chunks=chunks)
            self.twins = [
                Twin(self._open_twin(twin), extra=self.settings.extra_balls_of(twin))
                for twin in range(self.settings.twins)
            ]
            self.twin = self.twins[0]
            """The one that holds the ball that is played."""
            self.robots = (self.arm.frontend, *(twin.frontend for twin in self.twins))
            """Arm and twins, whose halts end episodes."""
        except BaseException:
            self._stack.close()
            raise

    def close(self) -> None:
        """Ends all that was started; may be called twice."""
        self._stack.close()

    def reset(
        self,
        _copies: object,
        *,
        arm_seeds: Sequence[int],
        twin_seeds: Sequence[int],
        flights: Sequence[Flights],
    ) -> None:
        """Arm and twins to the start; the balls fly from the next step on."""
        arm, (arm_seed,), (twin_seed,) = self.arm, arm_seeds, twin_seeds
        if not self._real_time:
            arm.reset(arm_seed)
        elif self.returns_at_reset:
            arm.go_back()
        for twin in self.twins:
            twin.reset(twin_seed)
        self.row = arm.read_newest()
        for twin, its_flights in zip(self.twins, self._shared(*flights), strict=True):
            twin.begin(arm.last_motion[0], its_flights)
        self._burst_twins(1)
        self.twin_row = self.twin.iteration

    def _shared(self, flights: Flights) -> Iterator[Flights]:
        """The flights of each twin's balls."""
        played, extra = list(flights[:1]), list(flights[1:])
        for twin in self.twins:
            share = twin.extra.stop - twin.extra.start
            yield played * twin.extra.start + extra[:share]
            extra = extra[share:]

    def begin(self) -> None:
        """An episode begins now, however long ago the reset was: by the clock the arm moved on."""
        self.arm.begin()
        if self._real_time:
            self.row = self.arm.newest

    @property
    def lateness(self) -> int:
        """Rows that the arm has made since the one used last: above 0 only by the clock."""
        return self.arm.newest - self.row if self._real_time else 0

    def step(self, pressures: FloatArray, _copies: object = EVERY, steps: int = 1) -> None:
        """The arm is asked for normalised pressures (1, 8), or with chunks for rows (n, 8), one
        each step; five rows of arm and twins in each of the `steps`.
        """
        self.ask(pressures)
        counts = self.counts
        for _ in range(steps):
            exact = self.step_arm()
            exact = self.step_twins() and exact
            lateness = self.lateness
            counts.steps += 1
            counts.exact_steps += exact
            counts.summed_lateness += lateness
            counts.largest_lateness = max(counts.largest_lateness, lateness)
        self.arm.settle()
        counts.late_actions += self.arm.late
        counts.starved_iterations += self.arm.starved

    def see_newest(self) -> None:
        """Reads the newest rows: a step that a halt has ended did not."""
        self.arm.read_newest()
        for twin in self.twins:
            twin.see(twin.frontend.latest())

    def ask(self, pressures: FloatArray) -> None:
        """Normalised pressures for the next steps."""
        self.arm.ask(pressures, at=self.row + 1 + self._delay)

    def step_arm(self) -> bool:
        """The arm makes the next five rows, or has made them by the clock.

        Returns whether they were exactly these five.
        """
        exact = self.arm.step(self.row + 1)
        self.row += ITERATIONS
        return exact

    def step_twins(self) -> bool:
        """All twins mirror the arm's last rows, at the same time.

        Returns whether the first one made exactly five rows.
        """
        if len(self.twins) == 1:
            self.twin.step(self.arm.motion, self._seen)
        else:
            for twin in self.twins:
                twin.mirror(self.arm.motion)
            self._burst_twins(ITERATIONS)
        exact = self.twin.iteration == self.twin_row + ITERATIONS
        self.twin_row = self.twin.iteration
        if self.after_step is not None:
            self.after_step()
        return exact

    @property
    def _seen(self) -> o80.Seen | None:
        """The row of the arm that the twins mirror. Without a clock rows of both are as many."""
        return self.arm.seen if self._real_time else None

    def twin_of(self, _copy: int) -> o80.Frontend:
        """Frontend of the first twin."""
        return self.twin.frontend

    def _burst_twins(self, iterations: int) -> None:
        """All twins run at the same time."""
        bursts = {twin.frontend: iterations for twin in self.twins}
        rows = o80.burst(bursts, timeout=TIMEOUT, seen=self._seen)
        for twin in self.twins:
            twin.see(rows[twin.frontend])

    def _open_arm(self) -> o80.Frontend:
        settings = self.settings
        if settings.attach:
            return self._attach()
        options = arm_options(settings)
        return self._open("pam", settings.arm_segment, settings.pacing.real_time, options)

    def _attach(self) -> o80.Frontend:
        """A frontend to the arm that runs already. Raises ValueError for another robot."""
        segment = self.settings.arm_segment
        assert segment is not None
        frontend = self._stack.enter_context(o80.Frontend(segment))
        if len(frontend.actuators) != MUSCLES:
            raise ValueError(
                f"segment '{segment}' is not a pneumatic arm: it has {len(frontend.actuators)} "
                f"actuators, not {MUSCLES} muscles. Start an arm with `o80 run pam` and give the "
                "name of its segment: arm_segment"
            )
        if not np.isclose(frontend.period, self.settings.period):
            frequency = 1.0 / frontend.period
            raise ValueError(
                f"the arm '{segment}' runs at {frequency:g} Hz, the rig at "
                f"{self.settings.frequency:g} Hz: give RigSettings(frequency={frequency:g}), or "
                "restart the arm"
            )
        return frontend

    def _open_twin(self, twin: int) -> o80.Frontend:
        if twin == 0 and self.settings.twin_segment is not None:
            return self._stack.enter_context(o80.Frontend(self.settings.twin_segment))
        return self._open("mujoco", None, False, twin_options(self.settings, twin))

    def _open(
        self, robot: str, segment: str | None, real_time: bool, options: dict[str, Any]
    ) -> o80.Frontend:
        """Starts a robot in the way of this rig, and opens a frontend to it."""
        settings = self.settings
        library = o80.robots.load(robot)
        common: dict[str, Any] = {
            "segment": segment or unused_name(robot),
            "frequency": settings.frequency,
            "history": settings.history,
        }
        if settings.pacing is Pacing.INLINE:
            frontend: o80.Frontend = library.inline(**common, **options)
            return self._stack.enter_context(frontend)
        process = self._stack.enter_context(
            library.start(bursting=not real_time, **common, **options)
        )
        return self._stack.enter_context(process.frontend())
