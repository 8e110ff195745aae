"""Steps N robots and their worlds in two inline groups."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, ExitStack
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.frontend.chunks import Chunks
from o80.frontend.frontend import Frontend
from o80.groups.inline_group import InlineGroup
from o80.hybrid.mirror import Motion
from o80.hybrid.plan import Plan
from o80.hybrid.rig import World, robot_of
from o80.hybrid.sides import Side, desired_of
from o80.hybrid.starts import BURST, Home, Starts
from o80.hybrid.worlds import Worlds
from o80.learning.task import Index
from o80.robots.robot import Robot

Numbers = NDArray[np.intp]


class Copies:
    """Engine of copies in this process, stepped by threads of C++."""

    stalled = ""
    """Reason why a step was impossible: never set here."""
    moved = False

    def __init__(self, plan: Plan, home: Home, copies: int, threads: int | None) -> None:
        rig = plan.rig
        robot = robot_of(rig.robot)
        with ExitStack() as stack:
            history = max(8 if home.place is None else BURST, 2 * plan.iterations)  # in the cache
            self._robots = self._group(
                stack, robot, rig.frequency, history, threads, copies, rig.robot_options
            )
            self.period = period = self._robots[0].period
            world = World(rig, plan.folder, self._robots[0].schema, robot.name)
            worlds = self._group(
                stack,
                world.robot,
                1 / period,
                history,
                self._robots,
                copies * (rig.worlds or 1),
                world.options,
            )
            motion = Motion(rig.mirror, world.pairs, copies, self._robots[0].schema)
            self._worlds = Worlds(worlds, world, motion, plan.iterations, copies, rig.worlds)
            self._prepare(plan, home, copies)
            self._stack = stack.pop_all()
        self.members, self.counts = (self._robots, worlds), self._worlds.counts
        self.first = desired_of(self._robots[0])

    def _prepare(self, plan: Plan, home: Home, copies: int) -> None:
        rig = plan.rig
        targets: list[int] | None = [] if plan.chunk_size else None
        self._burst = self._robots.prepared_burst(
            plan.iterations, targets, mode="overwrite", delay=0 if plan.chunk_size else rig.delay
        )
        self._both, self._all = self._worlds.after(self._burst), np.arange(copies)
        self._targets, self._played = self._burst.targets, plan.iterations * self.period
        self.robot, self.world = Side(self._robots, self._burst.rows), self._worlds.side
        self._worlds.feed(self._burst.rows)
        self._starts = Starts(self._robots, self.robot, copies, home)
        self.resets = self._starts.resets
        self._plans: list[Chunks] = []
        self._delay = rig.delay
        if plan.chunk_size:
            self._plans = [
                self._robots[copy].chunks(step=rig.every, profile=plan.profile)
                for copy in range(copies)
            ]

    @staticmethod
    def _group(
        stack: ExitStack,
        robot: Robot,
        frequency: float | None,
        history: int,
        threads: Any,
        copies: int,
        options: Any,
    ) -> InlineGroup:
        own: dict[str, Any] = {"history": history} | dict(options)
        group = robot.inline(copies=copies, threads=threads, frequency=frequency, **own)
        return stack.enter_context(group)

    def frontend(self, copy: int) -> Frontend:
        """Returns the frontend of a copy's robot."""
        return self._robots[copy]

    def reset(self, copies: Numbers, seeds: Sequence[tuple[int, int]]) -> None:
        """Resets robots and worlds, each world with the positions of its robot."""
        self._starts.begin(copies, [pair[0] for pair in seeds], self.period)
        if not self._starts.shows:
            self.robot.show(copies, self._robots.latest(copies)[:, np.newaxis])
        self._worlds.reset(copies, [pair[1] for pair in seeds], self.robot)

    def mirror(self, copies: Numbers) -> None:
        """Runs one iteration of these worlds, with the positions of their robots' newest rows."""
        self._worlds.mirror(copies, self.robot)

    def step(
        self, targets: Any, copies: Index, until_halted: Callable[[], AbstractContextManager[None]]
    ) -> None:
        """Steps these copies; the worlds of copies that halt in the step stay unchanged."""
        chosen = self._all[copies]
        if self._plans:
            for copy, rows in zip(chosen.tolist(), targets, strict=True):
                seen = int(self.robot.last["iteration"][copy]) + self._delay
                self._plans[copy].send(rows, seen=seen, fixed=True)
        else:
            self._targets[copies, 0] = targets
        if self._both is not None:
            self._worlds.counts.steps += 1
            self._worlds.counts.play += chosen.size * self._played
            with until_halted():
                self._both.run(copies)
            return
        with until_halted():
            self._burst.run(chosen)
        halted = self._robots.halted
        if halted:
            chosen = chosen[~np.isin(chosen, [*halted])]
        with until_halted():
            self._worlds.follow(chosen, self.robot.rows[chosen], self.period)

    def close(self) -> None:
        """Closes all copies; may be called twice."""
        for plan in self._plans:
            plan.close()
        self._stack.close()
