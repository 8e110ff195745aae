"""The lab in lock-step: arm, world, cameras and tracker burst, and nothing depends on the clock.

All times are simulated. After each step of 10 ms the cameras make the rows that are due, 180 a
second, each of which shows the ball as it was 25 ms before, and the tracker makes one for each of
theirs. So the policy sees the ball as late as in real time, and every run gives the same numbers.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

import o80

from ..environment import TableTennisEnvironment
from ..rig.rig import Rig, unused_name
from ..settings import Pacing, RigSettings, TaskSettings
from ..task.observer import exactly
from ..task.perception import EVERY, Perceived
from ..task.state import State
from .parts import CAMERAS, CAMERAS_ROBOT, RATES, TRACKER, TRACKER_ROBOT
from .tracked_perception import TrackedPerception

TIMEOUT = 10.0
"""Time limit for four images on a busy machine [s]."""


class LockStepTracking:
    """Tracking in lock-step: simulated cameras look at the ball of a rig's world."""

    def __init__(self, rig: Rig, pacing: Pacing, seed: int) -> None:
        self._world = rig.twin.frontend
        self._stack = ExitStack()
        try:
            eyes = {"ball": self._world.segment, "seed": seed, "history": 4}
            self.cameras = self._open(CAMERAS_ROBOT, CAMERAS, pacing, **eyes)
            sees = {"cameras": self.cameras.segment, "timeout": TIMEOUT}
            self.tracker = self._open(TRACKER_ROBOT, TRACKER, pacing, **sees)
        except BaseException:
            self.close()
            raise
        self._tracked = TrackedPerception(lambda: self.tracker, self._now)
        self._period = round(1e9 / RATES[CAMERAS])
        self._began, self._sees_it = 0, True
        self.errors: list[float] = []
        """Distances of the seen ball from the true one [m]."""
        self.observations = 0
        self.first_seen: list[float] = []
        """From the launch to the first observation that the ball was seen in [s]."""
        rig.after_step = self._catch_up

    def _open(self, robot: str, part: str, pacing: Pacing, **options: Any) -> o80.Frontend:
        library = o80.robots.load(robot)
        options |= {"segment": unused_name(part), "frequency": RATES[part]}
        if pacing is Pacing.INLINE:
            inline: o80.Frontend = library.inline(**options)
            return self._stack.enter_context(inline)
        process = self._stack.enter_context(library.start(bursting=True, **options))
        return self._stack.enter_context(process.frontend())

    def close(self) -> None:
        """Ends cameras and tracker."""
        self._stack.close()

    def _now(self) -> int:
        """Time of the newest row of the world [ns]."""
        return int(self._world.latest().time)

    def _catch_up(self) -> None:
        """Cameras and tracker make the rows that are due."""
        now = self._now()
        while self.cameras.latest().time + self._period <= now:
            images = self.cameras.burst(1, timeout=TIMEOUT)
            if not self._sees_it and int(images.extended.capture_time) > self._began:
                self.tracker.request("forget")  # the world has put the ball somewhere else
                self._sees_it = True
            self.tracker.burst(1, timeout=TIMEOUT)

    # ------------------------------------------------------------------ perception

    def begin(
        self,
        state: State,
        generators: Sequence[np.random.Generator],
        which: NDArray[np.int64],
    ) -> Perceived:
        """First perception of a new episode."""
        self._began, self._sees_it = self._now(), False
        return self._tracked.begin(state, generators, which)

    def perceive(self, state: State, which: Any = EVERY) -> Perceived:
        """After a step."""
        seen = self._tracked.perceive(state, which)
        self.observations += 1
        if seen.first:
            self.first_seen.append((self._tracked.at - self._began) * 1e-9)
        if not seen.missed[0]:
            self.errors.append(float(np.linalg.norm(seen.ball[0, :3] - state.ball[0, :3])))
        return seen


class TrueBall:
    """Perception without noise and delay, beside the filter that a policy is used to."""

    def begin(
        self,
        state: State,
        _generators: Sequence[np.random.Generator],
        _which: NDArray[np.int64],
    ) -> Perceived:
        """First perception of a new episode."""
        return exactly(state)

    def perceive(self, state: State, _which: object = EVERY) -> Perceived:
        """After a step."""
        return exactly(state)


@contextmanager
def tracked_environment(
    rig: RigSettings, task: TaskSettings, *, seed: int = 1
) -> Iterator[tuple[TableTennisEnvironment, LockStepTracking]]:
    """An environment that observes the tracked ball, and its tracking; `seed` is of the images.

    Raises ValueError if the arm has a clock of its own.
    """
    if rig.pacing.real_time:
        raise ValueError(
            "an arm in real time does not wait for cameras: choose Pacing.INLINE or PROCESSES"
        )
    with ExitStack() as stack:
        environment = stack.enter_context(TableTennisEnvironment(rig=rig, task=task))
        tracking = LockStepTracking(environment.rig, rig.pacing, seed)
        stack.callback(tracking.close)
        environment.observer.look_through(tracking)
        yield environment, tracking
