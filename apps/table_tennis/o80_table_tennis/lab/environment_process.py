"""The process of the environment: it plays the balls that the launcher launches, in real time.

Every 10 ms it publishes a row: by the clock of the arm while arm and world are there, else by its
own. It waits for what it needs, and says in each row what is missing; a ball during which arm or
world end is given up. When all balls were played its rows say so until it is asked to end.
"""

from __future__ import annotations

import signal
import time
from dataclasses import replace
from enum import IntEnum
from typing import Any

import numpy as np
import typer

import o80
from o80.base.screen import keep_printing

from ..balls.launches import Launch
from ..environment import TableTennisEnvironment
from ..players.learned_policy import shipped_policy
from ..players.policies import DEFAULT_FACTOR, Policy, default_policy
from ..rig.arm_numbers import ArmNumbers
from ..rig.home import LONGEST_RETURN
from ..rig.rig import arm_options
from ..settings import Pacing, TaskSettings
from .launching import Launching
from .parts import (
    ARM,
    CAMERAS,
    ENVIRONMENT,
    LAUNCHER,
    MOTION_CAPTURE,
    RATES,
    RIG,
    TRACKER,
    WORLD,
    LabSettings,
)
from .tracked_perception import TrackedPerception
from .watched import Watched

STEP = 1.0 / RATES[ENVIRONMENT]
"""[s]"""
WATCHED = (ARM, WORLD, LAUNCHER, CAMERAS, TRACKER, MOTION_CAPTURE)
"""Parts of which a row says whether they are missing."""
OPENING = (o80.BackendGone, o80.TimeoutError, o80.SegmentError)
"""Errors that are raised while arm or world end, or are missing."""


class Phase(IntEnum):
    """Phase in which the environment is."""

    waiting = 0
    """Arm or world is missing."""
    returning = 1
    """The arm goes back to its start."""
    launching = 2
    """The launcher was asked, or could not be asked yet; no ball has left it."""
    playing = 3
    over = 4
    """All balls were played."""


BALLS = ("ball", *(f"balls_{what}" for what in ("played", "touched", "returned", "given_up")))
COUNTS = (*BALLS, "launch", "launches_failed")
TIMES = ("arm_time", "ball_time", "observed_at")
PLACES = ("observed_ball", "true_ball")
EXTENDED: dict[str, Any] = {
    "phase": Phase,
    "missing": dict.fromkeys(WATCHED, np.bool_),
    "seen": np.bool_,
    "age": np.float64,
    **dict.fromkeys(("arm_row", "world_row", "late", *COUNTS, *TIMES), np.int64),
    **dict.fromkeys(PLACES, (np.float64, (3,))),
}
"""late: rows of the arm that were newer than the one used. launch: number of the launch that is
played, 0 between balls. observed_ball: what the policy observed last; observed_at: the time of the
row of the arm when it did. The ball was seen in images of ball_time, `age` [s] before that.
true_ball: of the world, now."""
UNITS = {"age": "s"} | dict.fromkeys(TIMES, "ns") | dict.fromkeys(PLACES, "m")


class EndRequestedError(Exception):
    """Asked to end, by a signal or by `o80 stop`."""


class EnvironmentProcess:
    """Plays so many balls (0: without end), and stays until it is asked to end."""

    def __init__(self, settings: LabSettings, backend: o80.Backend) -> None:
        self._settings, self._backend = settings, backend
        self._watched = {name: Watched(settings.segment(name)) for name in WATCHED}
        self._tracker = Watched(settings.segment(TRACKER))
        self._launching = Launching(settings)
        self._policy, self._task = policy_of(settings.policy)
        with o80.robots.load("pam").inline(**arm_options(RIG)) as arm:  # where the arm starts
            row = arm.latest()
            self._home = np.array(row.desired), np.array(row.extended.joint_positions)
        self._environment: TableTennisEnvironment | None = None
        self._perception: TrackedPerception | None = None
        self._due = time.monotonic() + STEP
        self.row: dict[str, Any] = {"phase": Phase.waiting, "arm_row": -1, "world_row": -1}
        self.row |= dict.fromkeys((*COUNTS, "ball_time"), 0)
        self._stopping = False

    def stop(self, *_signal: object) -> None:
        """The next row is the last one."""
        self._stopping = True

    def publish(self) -> None:
        """A row, and the beginning of the next one. Raises EndRequestedError."""
        row = self.row
        row["missing"] = {name: watched.missing for name, watched in self._watched.items()}
        self._backend.publish(extended=row)
        if self._backend.step() is None or self._stopping:
            raise EndRequestedError

    def _after_step(self) -> None:
        """A step of 10 ms of arm and world."""
        assert self._environment is not None
        task, row = self._environment.task, self.row
        row["arm_row"], row["world_row"] = task.single.span[2], task.twin_row
        row["arm_time"] = self._arm_time()
        row["late"] = task.single.lateness
        row["true_ball"] = task.rows.balls[0, :3]
        self._tell_observed()
        self.publish()

    def _tell_observed(self) -> None:
        """Writes into the row what the policy saw last, while it plays."""
        row, seen = self.row, self._perception
        time, at, ball = 0, 0, np.full(3, np.nan)
        if row["phase"] is Phase.playing and seen is not None:
            time, at, ball = seen.ball_time, seen.at, seen.ball[:3]
        row["seen"], row["ball_time"], row["observed_at"] = time > 0, time, at
        row["age"] = (at - time) * 1e-9 if time else np.nan
        row["observed_ball"] = ball

    def _by_own_clock(self) -> None:
        """A row without arm and world, when it is due."""
        now = time.monotonic()
        self._due = max(self._due + STEP, now)
        time.sleep(max(0.0, self._due - now))
        self._tell_observed()
        self.publish()

    # ------------------------------------------------------------------ balls

    def run(self) -> None:
        """Until it is asked to end."""
        self._backend.publish(extended=self.row | {"missing": dict.fromkeys(WATCHED, True)})
        self._backend.step()
        try:
            while not self._settings.balls or self.row["balls_played"] < self._settings.balls:
                self._try_ball()
            self._close_environment()
            self._set(Phase.over)
            self.row["late"] = 0
            while True:
                self._by_own_clock()
        except EndRequestedError:
            pass
        finally:
            self._close_environment()

    def _try_ball(self) -> None:
        environment = self._environment
        if environment is None:
            self._open()
            return
        try:
            self._return(environment)
            launch = self._launch(environment)
            if launch is not None:
                self._play(environment, launch)
        except OPENING:
            if self.row["phase"] is Phase.playing:
                self.row["balls_given_up"] += 1
            self._close_environment()
            self._set(Phase.waiting)

    def _open(self) -> None:
        """Opens the environment if arm and world are there; else a row says so."""
        self._set(Phase.waiting)
        self._by_own_clock()
        if any(self._watched[name].frontend() is None for name in (ARM, WORLD)):
            return
        of = self._settings.segment
        rig = replace(
            RIG, pacing=Pacing.REAL_TIME, attach=True, arm_segment=of(ARM), twin_segment=of(WORLD)
        )
        try:
            self._environment = TableTennisEnvironment(rig=rig, task=self._task)
        except OPENING:
            return
        task = self._environment.task
        # the arm may stand anywhere now
        task.home_of_arm.pressures, task.home_of_arm.angles = self._home
        self._perception = TrackedPerception(self._tracker.frontend, self._arm_time)
        task.observer.look_through(self._perception)
        task.after_step, task.returns_at_reset = self._after_step, False

    def _arm_time(self) -> int:
        """Time of the row of the arm that was read last [ns]."""
        assert self._environment is not None
        return int(self._environment.task.robot.last["time"][0])

    def _close_environment(self) -> None:
        if self._environment is not None:
            self._environment.close()
        self._environment = None

    def _return(self, environment: TableTennisEnvironment) -> None:
        """The arm goes back while the world goes on."""
        self._set(Phase.returning)
        task = environment.task
        task.single.begin()
        task.home_of_arm.begin()
        end = time.monotonic() + LONGEST_RETURN
        while True:
            task.idle()
            if task.home_of_arm.reached or time.monotonic() > end:
                return

    def _launch(self, environment: TableTennisEnvironment) -> Launch | None:
        """Asks for a ball until one has left the launcher; None: the launcher failed."""
        self._set(Phase.launching)
        self._launching.ask()
        while True:
            environment.task.idle()
            launch = self._launching.came()
            if launch is not None:
                return launch
            if self._launching.failed:
                self.row["launches_failed"] += 1
                return None

    def _play(self, environment: TableTennisEnvironment, launch: Launch) -> None:
        """One ball, from the launch on."""
        flight = launch.flight(RIG.period)
        seed = self._settings.seed if self.row["balls_played"] == 0 else None
        observation, _ = environment.reset(seed=seed, options={"flight": flight})
        self._policy.reset()
        self._set(Phase.playing)
        self.row["launch"] = self._launching.number
        for robot in (environment.arm, *environment.twins):  # one moment of both clocks
            robot.mark(f"launch {self._launching.number}")
        over = False
        while not over:
            observation, _, terminated, truncated, info = environment.step(
                self._policy.act(observation)
            )
            over = terminated or truncated
        self.row["launch"] = 0
        self.row["balls_played"] += 1
        self.row["balls_given_up"] += bool(info["stalled"])
        self.row["balls_touched"] += bool(info["touched"])
        self.row["balls_returned"] += bool(info["returned"])

    def _set(self, phase: Phase) -> None:
        self.row["phase"] = phase
        self.row["ball"] = self.row["balls_played"] + (phase is not Phase.over)
        if phase is not Phase.playing:
            self.row["launch"] = 0


def policy_of(name: str) -> tuple[Policy, TaskSettings]:
    """A policy, and the task with its own actions and observation."""
    if name == "learned":
        learned = shipped_policy()  # its noise sets the filter of the observer
        return learned, learned.conditions.task(fly_out=False)
    return default_policy(ArmNumbers.of_rig(RIG)), TaskSettings(factor=DEFAULT_FACTOR)


def main(prefix: str = "lab", balls: int = 5, seed: int = 1, policy: str = "learned") -> None:
    """Plays so many balls (0: without end); ends at Ctrl-C, SIGTERM or `o80 stop`."""
    settings = LabSettings(balls, seed, policy, prefix)
    with o80.Backend(
        settings.segment(ENVIRONMENT), extended=EXTENDED, units=UNITS, frequency=RATES[ENVIRONMENT]
    ) as backend:
        process = EnvironmentProcess(settings, backend)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, process.stop)
        process.run()
        print(
            f"{process.row['balls_played']} balls played, {process.row['balls_returned']} returned"
        )


if __name__ == "__main__":
    keep_printing()
    typer.run(main)
