"""Steps one robot and its world by frontends: inline, in processes, or by the robot's clock."""

import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, ExitStack, suppress
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

import o80._core as _core
from o80.base.errors import Error, InvalidArgument, TimeoutError
from o80.frontend.chunk_parts import SentChunk
from o80.frontend.frontend import Frontend
from o80.groups.inline_group import InlineGroup
from o80.hybrid.mirror import Motion
from o80.hybrid.plan import Plan
from o80.hybrid.rig import World, attach, robot_of, unused_name
from o80.hybrid.sides import Side, desired_of
from o80.hybrid.starts import Home, Starts
from o80.hybrid.tracked import Tracked
from o80.hybrid.worlds import TIMEOUT, Worlds
from o80.learning.task import Index
from o80.robots.robot import Robot

Pacing = Literal["inline", "processes", "real_time"]
_ONLY = np.zeros(1, np.intp)


@dataclass
class Tolerances:
    """Limits for an episode by the clock; beyond one of them the episode ends."""

    max_late: int
    """Rows by which the robot may be ahead at the begin of a step."""
    max_drift: float
    """Time of the robot's rows minus the time of as many periods, since the episode began [s]."""
    max_missed: int
    """Consecutive rows without a reading."""


class Single:
    """Engine of one robot and its world."""

    def __init__(
        self,
        plan: Plan,
        home: Home,
        pacing: Pacing,
        attach: str | None,
        tolerances: Tolerances,
    ) -> None:
        rig = plan.rig
        self._clocked = pacing == "real_time"
        self.iterations, self._delay, self._every = plan.iterations, rig.delay, rig.every
        self._tolerances = tolerances
        with ExitStack() as stack:
            self._stack = stack
            if attach is not None:
                name = attach
                robot = stack.enter_context(Frontend(attach))
                if robot.bursting is self._clocked:
                    way = "bursts" if robot.bursting else "runs by its clock"
                    raise InvalidArgument(
                        f"robot '{attach}' {way}: pacing='{pacing}' cannot use it"
                    )
            else:
                library = robot_of(rig.robot)
                name = library.name
                robot = self._open(library, pacing, rig.frequency, dict(rig.robot_options))
            self.period = robot.period
            self._robot = robot
            self.frontends = [robot]
            """Frontends of the robot and of its worlds, by names that other programs find."""
            self._worlds = self._open_worlds(plan, pacing, name)
            self.motion, self.counts = self._worlds.motion, self._worlds.counts
            self._prepare(plan, home)
            self._stack = stack.pop_all()
        self.members = robot, self._worlds.member
        if isinstance(self._worlds.member, Frontend):
            self.frontends.append(self._worlds.member)

    def _prepare(self, plan: Plan, home: Home) -> None:
        robot, count = self._robot, self.iterations
        self._burst = self._plan = None
        if plan.chunk_size:
            self._plan = self._stack.enter_context(
                robot.chunks(step=self._every, profile=plan.profile)
            )
        elif robot.bursting:
            self._burst = robot.prepared_burst(count, mode="overwrite")
        rows = np.zeros((1, count), robot.history(1).rows.dtype)
        if self._burst is not None:
            rows = self._burst.rows[np.newaxis]
        self._worlds.feed(rows)
        self.robot, self.world = Side(robot, rows), self._worlds.side
        self.first, self._epoch = desired_of(robot), robot.latest().epoch
        self._starts = None if self._clocked else Starts(robot, self.robot, 1, home)
        self.resets = self._starts is not None and self._starts.resets
        self.stalled = ""
        self.moved = False
        self._row = self._reset_row = 0
        self._begins = True
        self._began = 0, 0
        self._planned_until: int | None = None
        self._batch: _core.Batch | None = None
        self._chunk: SentChunk | None = None

    def _open(
        self,
        library: Robot,
        pacing: Pacing,
        frequency: float | None,
        options: dict[str, Any],
        world: bool = False,
    ) -> Frontend:
        """Starts a robot with the pacing of this rig, and opens a frontend to it."""
        segment = options.pop("segment", None) or unused_name(library)
        if pacing == "inline":
            frontend: Frontend = library.inline(segment, frequency=frequency, **options)
            return self._stack.enter_context(frontend)
        self._stack.callback(_clean, segment)  # a killed process leaves its segment
        bursting = world or not self._clocked
        process = self._stack.enter_context(
            library.start(segment, frequency=frequency, bursting=bursting, **options)
        )
        return self._stack.enter_context(process.frontend())

    def _open_worlds(self, plan: Plan, pacing: Pacing, name: str) -> Worlds | Tracked:
        rig, robot = plan.rig, self._robot
        running = None
        if isinstance(rig.world, attach):
            running = self._stack.enter_context(Frontend(rig.world.segment))
            if self._clocked and not running.bursting:
                return Tracked(running, robot, plan, self._tolerances.max_late)
            if not running.bursting:
                raise InvalidArgument(
                    f"world '{running.segment}' runs by its clock: it is only read, in "
                    "pacing='real_time'"
                )
        schema = None if running is None else running.schema
        world = World(rig, plan.folder, robot.schema, name, schema)
        motion = Motion(rig.mirror, world.pairs, 1, robot.schema)
        member = running or self._open_world(plan, pacing, world)
        return Worlds(member, world, motion, plan.iterations, 1, rig.worlds)

    def _open_world(self, plan: Plan, pacing: Pacing, world: World) -> InlineGroup | Frontend:
        """Starts the world with the pacing of this rig; several worlds as a group, inline."""
        count = plan.rig.worlds or 1
        if count == 1:
            return self._open(world.robot, pacing, 1 / self.period, world.options, world=True)
        options = {"history": max(256, 4 * plan.iterations)} | world.options
        group = self._stack.enter_context(
            world.robot.inline(copies=count, frequency=1 / self.period, **options)
        )
        name = unused_name(world.robot)
        for number in range(count):  # recordings find the worlds by their names
            group.publish(number, f"{name}-{number}")
            self.frontends.append(self._stack.enter_context(Frontend(f"{name}-{number}")))
        return group

    def frontend(self, _copy: int) -> Frontend:
        """Returns the frontend of the robot."""
        return self._robot

    # ------------------------------------------------------------------ episodes

    def reset(self, _copies: NDArray[np.intp], seeds: Sequence[tuple[int, int]]) -> None:
        """Resets robot and world; the task has moved a robot with a clock home before."""
        ((robot_seed, world_seed),) = seeds
        if self._starts is not None:
            self._starts.begin(_ONLY, [robot_seed], self.period)
        self.robot.rows[...] = self._robot.history(1).rows
        self._row = self._reset_row = int(self.robot.last["iteration"][0])
        self._worlds.reset(_ONLY, [world_seed], self.robot)
        self.stalled, self.moved, self._begins = "", False, True

    @property
    def lateness(self) -> int:
        """Number of rows that the robot has published since the last row that a step used."""
        return self._robot.published - self._row

    @property
    def span(self) -> tuple[int, int, int]:
        """Iterations of the robot: in the reset, before the first step, after the last step."""
        return self._reset_row, self._began[0], self._row

    def mirror(self, _copies: NDArray[np.intp]) -> None:
        """Runs one iteration of the world, with the positions of the robot's newest row."""
        self._worlds.mirror(_ONLY, self.robot, self._seen)

    @property
    def _seen(self) -> _core.Seen | None:
        """The newest row that was used, if robots share a clock."""
        if not self._clocked:
            return None
        row = self.robot.last
        iteration, taken = int(row["iteration"][0]), int(row["time"][0])
        return _core.Seen(self._epoch, iteration, taken, self._robot.schema["clock"])

    def begin(self) -> None:
        """Makes the next step follow the newest row, as a robot with a clock has continued."""
        self._begins, self._planned_until, self.stalled = False, None, ""
        if self._clocked:
            before = self.motion.standing(self.robot.last)[0]
            self.robot.rows[...] = self._robot.history(1).rows
            now = self.motion.standing(self.robot.last)[0]
            self.moved = bool(np.abs(now - before).max() > 0.01)
            self.motion.begin(_ONLY, self.robot.last)
        self._row = int(self.robot.last["iteration"][0])
        self._began = self._row, int(self.robot.last["time"][0])

    # ------------------------------------------------------------------ steps

    def step(
        self,
        targets: Any,
        _copies: Index,
        until_halted: Callable[[], AbstractContextManager[None]],
    ) -> None:
        """Runs one step, or only sets `stalled` to a text if the robot is too far ahead.

        targets: (1, actuators), or chunks (1, rows, actuators); None: nothing is sent.
        """
        if self._begins:
            self.begin()
        first = self._row + 1
        if self._clocked and self._is_late():
            return
        done = 0
        with until_halted():
            self._batch = self._chunk = None
            if targets is not None:
                self._send(targets[0], first + self._delay)
            self._rows(first)
            done = 1
            self._count_late(first + self._delay)
            self._worlds.follow(_ONLY, self.robot.rows, self.period, self._seen)
            done = 2
        if done == 0:  # a halt has ended the step
            self.robot.rows[...] = self._robot.history(1).rows
            return
        if done == 1:
            self._worlds.see_newest()
        self.stalled = self._worlds.stalled
        if self.motion.missed[0] > self._tolerances.max_missed:
            self.stalled = f"{self.motion.missed[0]} rows in sequence brought no reading"

    def _is_late(self) -> bool:
        late = self.lateness
        row, since = self._began
        passed = int(self.robot.last["time"][0]) - since
        drift = passed * 1e-9 - (self._row - row) * self.period
        counts, most = self.counts, self._tolerances
        counts.late_steps += late > 0
        counts.summed_lateness += late
        counts.largest_lateness = max(counts.largest_lateness, late)
        counts.largest_drift = max(counts.largest_drift, drift)
        if late > most.max_late:
            self.stalled = f"the step began {late} rows late, more than max_late={most.max_late}"
        elif drift > most.max_drift:
            self.stalled = (
                f"the robot skipped {drift:.3g} s since the episode began, more than "
                f"max_drift={most.max_drift:g} s"
            )
        return bool(self.stalled)

    def _send(self, targets: Any, at: int) -> None:
        if self._plan is not None:
            self._chunk = self._plan.send(targets, seen=at - 1, fixed=True)
            self._rows_sent = len(targets)
        elif self._burst is not None:
            self._burst.targets[...] = targets
        else:  # set-points, as those of a prepared burst
            try:
                for actuator, target in enumerate(np.asarray(targets).tolist()):
                    self._robot.add_command(actuator, target, mode="overwrite")
            except BaseException:
                self._robot.forget_added()
                raise
            self._batch = self._robot.pulse(at=at, late="now", seen=self._seen)

    def _rows(self, first: int) -> None:
        """Runs the robot for the rows of a step, or waits for them if it has a clock."""
        last, robot = first + self.iterations - 1, self._robot
        if self._burst is not None:
            self._burst.run(TIMEOUT, at=first + self._delay, late="now")
        else:
            if not robot.bursting:
                robot.wait_for(last, timeout=TIMEOUT + self.iterations * self.period)
            elif robot.published < last:
                robot.burst(last - robot.published, timeout=TIMEOUT)
            self.robot.rows[0] = robot.history(since=first, until=last).rows
        self._row = last

    def _count_late(self, at: int) -> None:
        if self._batch is not None:
            self.counts.late_actions += not self._batch.taken or self._batch.first_iteration > at
        elif (chunk := self._chunk) is not None:
            end = time.monotonic() + TIMEOUT
            while not chunk.decided and time.monotonic() < end:
                with suppress(TimeoutError):  # a rejection is reported after the row of the command
                    self._robot.wait_for(self._robot.published + 1, timeout=0.01)
            rows = self._rows_sent
            self.counts.late_actions += rows if chunk.late is None else chunk.late
            if chunk.begins is not None:
                planned = at - 1 if self._planned_until is None else self._planned_until
                self.counts.starved += max(0, chunk.begins - 1 - planned)
                self._planned_until = at - 1 + self._every * rows

    def close(self) -> None:
        """Closes everything that was started; may be called twice."""
        self._stack.close()


def _clean(segment: str) -> None:
    with suppress(Error):
        _core.clean(segment)
