"""Process of the environment: plays the launcher's balls in real time.

Publishes a row every 10 ms, by the arm's clock while arm and world run, else by its own clock.
Each row names the missing processes, for which the environment waits. If arm or world end during
a ball, the ball is given up. After the last ball, rows have the phase `over` until the end.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from enum import IntEnum
from typing import Any

import numpy as np
import typer

import o80
from o80.base.screen import keep_printing

from ..ending import ends_in_order
from ..environment import TableTennisEnvironment
from ..evaluate import named_policy
from ..rig.home import LONGEST_RETURN, Home
from ..rig.rig import arm_options
from ..settings import Pacing
from ..task.tracked_perception import TrackedPerception
from .counterparts import Launching
from .parts import ARM, ENVIRONMENT, RATES, RIG, TRACKER, WATCHED, WORLD, LabSettings
from .processes import Watched

STEP = 1.0 / RATES[ENVIRONMENT]
"""Interval of rows [s]."""
OPENING = (o80.BackendGone, o80.TimeoutError, o80.SegmentError)
"""Errors while arm or world end, or are missing."""


class Phase(IntEnum):
    """Phase of the environment: arm or world are missing; the arm returns to its start; the ball is
    not launched yet; a ball is played; all balls were played.
    """

    waiting = 0
    returning = 1
    launching = 2
    playing = 3
    over = 4


COUNTS = tuple(f"balls_{what}" for what in ("played", "touched", "returned", "given_up"))
TIMES = ("arm_time", "ball_time", "observed_at")
PLACES = ("observed_ball", "true_ball")
EXTENDED: dict[str, Any] = {
    "phase": Phase,
    "missing": dict.fromkeys(WATCHED, np.bool_),
    **dict.fromkeys(("arm_row", "world_row", "late", *COUNTS, *TIMES), np.int64),
    **dict.fromkeys(PLACES, (np.float64, (3,))),
}
"""late: number of the arm's rows that were newer than the used one. observed_ball: last observation
of the policy; observed_at: time of the arm's row at that observation. ball_time: time of the
images with the ball; 0: not seen. true_ball: current ball of the world."""
UNITS = dict.fromkeys(TIMES, "ns") | dict.fromkeys(PLACES, "m")


class EnvironmentProcess:
    """Plays a number of balls (0: without end), and runs until a stop is requested."""

    def __init__(self, settings: LabSettings, backend: o80.Backend) -> None:
        self._settings, self._backend = settings, backend
        self._watched = {name: Watched(settings.segment(name)) for name in WATCHED}
        self._launching = Launching(settings)
        self._policy, conditions = named_policy(settings.policy, preset=RIG.preset)
        self._task = conditions.task(fly_out=False)
        with o80.robots.load("pam").inline(**arm_options(RIG)) as arm:  # start of the arm
            self._home = Home(arm)
        self._environment: TableTennisEnvironment | None = None
        self._due = time.monotonic() + STEP
        self._row: dict[str, Any] = {"phase": Phase.waiting, "arm_row": -1, "world_row": -1}
        self._row |= dict.fromkeys(COUNTS, 0)

    def _publish(self) -> None:
        """Publishes a row and begins the next one. Exits if a stop is requested."""
        row = self._row
        row["missing"] = {name: watched.missing for name, watched in self._watched.items()}
        seen = self._perception if row["phase"] is Phase.playing else None
        row["ball_time"], row["observed_at"] = (seen.ball_time, seen.at) if seen else (0, 0)
        row["observed_ball"] = seen.ball[:3] if seen else np.full(3, np.nan)
        self._backend.publish(extended=row)
        if self._backend.step() is None:
            sys.exit()

    def _by_own_clock(self) -> None:
        """Waits for its own period, and publishes a row."""
        now = time.monotonic()
        self._due = max(self._due + STEP, now)
        time.sleep(max(0.0, self._due - now))
        self._publish()

    def run(self) -> None:
        """Plays, and publishes rows until a stop is requested."""
        row, balls = self._row, self._settings.balls
        try:
            while not balls or row["balls_played"] < balls:
                environment = self._environment = self._environment or self._opened()
                try:
                    if environment is not None:
                        self._try_ball(environment)
                except OPENING:
                    row["balls_given_up"] += row["phase"] is Phase.playing
                    self._close_environment()
            self._close_environment()
            row |= {"phase": Phase.over, "late": 0}
            while True:
                self._by_own_clock()
        finally:
            self._close_environment()

    def _opened(self) -> TableTennisEnvironment | None:
        """Publishes a row; returns a new environment if arm and world run, else None."""
        self._row["phase"] = Phase.waiting
        self._by_own_clock()
        if any(self._watched[name].now is None for name in (ARM, WORLD)):
            return None
        arm, twin = map(self._settings.segment, (ARM, WORLD))
        rig = replace(RIG, attach=True, arm_segment=arm, twin_segment=twin)
        rig = replace(rig, pacing=Pacing.REAL_TIME)
        try:
            environment = TableTennisEnvironment(rig=rig, task=self._task)
        except OPENING:
            return None
        task, row, tracker = environment.task, self._row, self._watched[TRACKER]

        def arm_time() -> int:
            return int(task.robot.last["time"][0])

        def after_step() -> None:
            row["arm_row"], row["world_row"] = task.single.span[2], task.twin_row
            row["arm_time"], row["late"] = arm_time(), task.single.lateness
            row["true_ball"] = task.rows.balls[0, :3]
            self._publish()

        task.home_of_arm = self._home.of(environment.arm)  # the arm may be anywhere now
        self._perception = TrackedPerception(lambda: tracker.now, arm_time)
        task.observer.look_through(self._perception)
        task.after_step, task.returns_at_reset = after_step, False
        return environment

    def _close_environment(self) -> None:
        if self._environment is not None:
            self._environment.close()
        self._environment = None

    def _try_ball(self, environment: TableTennisEnvironment) -> None:
        """Returns the arm, requests a ball and plays it, unless the launcher fails."""
        row, task, launching = self._row, environment.task, self._launching
        row["phase"] = Phase.returning
        task.single.begin()
        task.home_of_arm.begin()
        end = time.monotonic() + LONGEST_RETURN
        task.idle()
        while not task.home_of_arm.reached and time.monotonic() < end:
            task.idle()

        row["phase"], launch = Phase.launching, None
        launching.ask()
        while launch is None and not launching.failed:
            task.idle()
            launch = launching.came()
        if launch is None:
            return

        seed = self._settings.seed if row["balls_played"] == 0 else None
        options = {"flight": launch.flight(RIG.period)}
        observation, _ = environment.reset(seed=seed, options=options)
        self._policy.reset()
        row["phase"], over = Phase.playing, False
        for robot in (environment.arm, *environment.twins):  # marks one moment on both clocks
            robot.mark(f"launch {launching.number}")
        while not over:
            action = self._policy.act(observation)
            observation, _, terminated, truncated, info = environment.step(action)
            over = terminated or truncated
        for count, what in zip(COUNTS[1:], ("touched", "returned", "stalled"), strict=True):
            row[count] += bool(info[what])
        row["balls_played"] += 1


def main(prefix: str = "lab", balls: int = 5, seed: int = 1, policy: str = "learned") -> None:
    """Plays a number of balls (0: without end); ends at Ctrl-C, SIGTERM or `o80 stop`."""
    settings, rate = LabSettings(balls, seed, policy, prefix), RATES[ENVIRONMENT]
    name = settings.segment(ENVIRONMENT)
    with (
        ends_in_order(),
        o80.Backend(name, extended=EXTENDED, units=UNITS, frequency=rate) as backend,
    ):
        EnvironmentProcess(settings, backend).run()


if __name__ == "__main__":
    keep_printing()
    typer.run(main)
