"""Replays recorded robots in new worlds: transitions without moving the robot again."""

import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, closing
from dataclasses import dataclass
from inspect import signature
from itertools import groupby
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.base.errors import InvalidArgument
from o80.hybrid.mirror import Motion
from o80.hybrid.plan import Plan
from o80.hybrid.rig import World
from o80.hybrid.sides import Side
from o80.hybrid.worlds import Worlds
from o80.learning.environment import Environment
from o80.recording.reader import RecordedSegment, RecordingFile

_ONLY = np.zeros(1, np.intp)


@dataclass(frozen=True)
class Transitions:
    """An episode of T steps of a recorded robot, in W worlds."""

    observations: NDArray[Any]  #: (T + 1, W, ...)
    actions: NDArray[Any]  #: (T, ...)
    rewards: NDArray[np.float64]  #: (T, W)
    terminated: NDArray[np.bool_]  #: (T, W)
    truncated: NDArray[np.bool_]  #: (T, W)
    running: NDArray[np.bool_]  #: (T, W) transitions that count: the world's episode had not ended


def relive(
    path: str | os.PathLike[str],
    task: type[Any],
    *,
    worlds: int | None = None,
    seed: int | None = None,
    segment: str | None = None,
    **parameters: Any,
) -> Iterator[Transitions]:
    """Mirrors a recorded robot in new worlds, without pauses; yields one item for each episode.

    task: a class derived from HybridTask.
    path: a recording of an environment of the task (`record=`): its marks hold the episodes with
        options, actions and parameters. In a recording without these marks episodes follow each
        other directly, and the task's `action_of` returns the actions.
    worlds: worlds of the robot (None: those of the rig).
    seed: seed of new draws; None: the draws of the recording.
    segment: segment of the robot, in a recording without these marks.
    parameters: parameters of the task, instead of the recorded ones.

    An episode ends with its last world, or where the recorded episode ended. Raises
    InvalidArgument for a wrong task or missing rows, RecordingError for an unreadable recording.
    """
    takes = signature(task).parameters.values() if hasattr(task, "_parameters") else ()
    if not any(each.name == "recorded" or each.kind is each.VAR_KEYWORD for each in takes):
        raise InvalidArgument(
            "task must be a class derived from o80.hybrid.HybridTask whose `__init__` accepts the "
            f"argument `recorded`, got {task!r}"
        )
    draws = np.random.SeedSequence(seed)
    for robot, group in groupby(_spans(RecordingFile(path), segment), attrgetter("robot")):
        spans = list(group)
        options = spans[0].parameters
        own = {name: options[name] for name in task._parameters() & options.keys()} | parameters
        number = options.get("worlds") if worlds is None else worlds
        with closing(task(recorded=robot, worlds=number, **own)) as made:
            environment = Environment(made)
            for span in spans:
                environment.np_random = np.random.default_rng(draws.spawn(1)[0])
                if seed is None and span.generator is not None:
                    environment.np_random.bit_generator.state = span.generator
                yield from _played(environment, span)


@dataclass
class _Span:
    """Rows of one recorded episode; or, without actions, of many."""

    robot: RecordedSegment
    parameters: Mapping[str, Any]
    options: dict[str, Any]
    generator: Any  # state of the generator before the reset
    actions: Sequence[Any] | None
    reset: int  # row that the worlds mirrored in the reset
    first: int  # newest row at the begin of the first step
    last: int


def _spans(recording: RecordingFile, segment: str | None) -> Iterator[_Span]:
    robot, parameters, begun = None, {}, None
    for mark in recording.marks:
        values = mark.values
        if mark.name == "environment" and "robot" in values:
            robot, parameters, begun = recording[values["robot"]], values["options"], None
        elif mark.name in ("episode", "episode_dropped"):
            begun = values if mark.name == "episode" else None
        elif mark.name == "episode_end" and robot is not None and begun is not None:
            if not {"generator", "options", "actions", "rows"} <= begun.keys() | values.keys():
                raise InvalidArgument(
                    f"{recording.path}: its marks of episodes are not those that `record=` of an "
                    "o80.hybrid environment writes"
                )
            state, actions = json.loads(begun["generator"]), values["actions"]
            yield _Span(robot, parameters, begun["options"], state, actions, *values["rows"])
    if robot is not None:
        return
    if segment is None and len(recording) != 1:
        raise InvalidArgument(
            f"{recording.path} has no marks of an environment, and {len(recording)} segments: name "
            f"that of the robot, segment='{next(iter(recording), '...')}'"
        )
    robot = recording[segment or next(iter(recording))]
    rows = robot.history().rows["iteration"]
    yield _Span(robot, {}, {}, None, None, int(rows[0]), int(rows[0]), int(rows[-1]))


def _played(environment: Environment, span: _Span) -> Iterator[Transitions]:
    task: Any = environment.task
    engine: Recorded = task.engine
    over = True
    while span.first + engine.iterations <= span.last and (over or span.actions is None):
        engine.seek(span.reset, span.first)
        seen = [_by_world(*environment.reset(options=span.options))]
        actions: list[Any] = []
        over = False
        while not over and span.first + engine.iterations <= span.last:
            if span.actions is None:
                action = task.action_of(engine.rows_of_step())
            else:
                action = span.actions[len(actions)]
            actions.append(np.asarray(action, environment.action_space.dtype))
            observed, reward, terminated, truncated, info = environment.step(actions[-1])
            seen.append(_by_world(observed, info, reward, terminated, truncated))
            over = terminated or truncated
            span.first += engine.iterations
        span.reset = span.first
        observations, *columns = (np.stack(each) for each in zip(*seen, strict=True))
        rewards, ended, cut, running = (each[1:] for each in columns)
        cut[-1] |= running[-1] & ~ended[-1]
        yield Transitions(observations, np.stack(actions), rewards, ended, cut, running)
        over = span.actions is None


def _by_world(
    observed: Any, info: Any, reward: float = 0.0, terminated: bool = False, truncated: bool = False
) -> tuple[Any, ...]:
    """Returns observation, reward, terminated, truncated, running: (worlds, ...)."""
    if "worlds" in info:
        return tuple(info["worlds"].values())
    return tuple(np.array([each]) for each in (observed, reward, terminated, truncated, True))


class Recorded:
    """Engine of a recorded robot: worlds in this process mirror its recorded rows."""

    stalled, moved, resets, first = "", False, True, ()

    def __init__(self, plan: Plan, robot: RecordedSegment) -> None:
        rig, self.iterations = plan.rig, plan.iterations
        self._all = robot.history().rows
        schema = robot.schema
        self.period = schema["period"] * 1e-9
        world = World(rig, plan.folder, schema, robot.name)
        options = {"frequency": 1 / self.period, "history": max(64, 2 * plan.iterations)}
        with ExitStack() as stack:
            group = stack.enter_context(
                world.robot.inline(copies=rig.worlds or 1, **options, **world.options)
            )
            motion = Motion(rig.mirror, world.pairs, 1, schema)
            self._worlds = Worlds(group, world, motion, plan.iterations, 1, rig.worlds)
            self._stack = stack.pop_all()
        self.members, self.counts, self.world = (group,), self._worlds.counts, self._worlds.side
        rows = np.zeros((1, plan.iterations), self._all.dtype)
        self.robot = Side(None, rows, schema=schema)

    def seek(self, reset: int, first: int) -> None:
        """Selects an episode: row of its reset, and newest row at the begin of its first step."""
        self._reset, self._row = reset, first
        self._begins = True

    def reset(self, copies: NDArray[np.intp], seeds: Sequence[tuple[int, int]]) -> None:
        """Resets the worlds."""
        self.robot.rows[...] = self._rows(self._reset, 1)
        self._worlds.reset(copies, [pair[1] for pair in seeds], self.robot)

    def mirror(self, copies: NDArray[np.intp]) -> None:
        """Runs one iteration of the worlds."""
        self._worlds.mirror(copies, self.robot)

    def rows_of_step(self) -> NDArray[Any]:
        """Returns the robot's rows (iterations,) of the next step."""
        return self._rows(self._row + 1, self.iterations)

    def step(
        self, _targets: Any, _copies: Any, until_halted: Callable[[], AbstractContextManager[None]]
    ) -> None:
        """Runs one step, as recorded."""
        if self._begins:
            self._begins = False
            self._worlds.motion.begin(_ONLY, self._rows(self._row, 1))
        self.robot.rows[0] = self.rows_of_step()
        self._row += self.iterations
        with until_halted():
            self._worlds.follow(_ONLY, self.robot.rows, self.period)

    def _rows(self, first: int, count: int) -> NDArray[Any]:
        """Returns `count` rows from `first` on. Raises InvalidArgument if one is missing."""
        begin = int(np.searchsorted(self._all["iteration"], first))
        rows = self._all[begin : begin + count]
        if len(rows) < count or rows["iteration"][[0, -1]].tolist() != [first, first + count - 1]:
            raise InvalidArgument(
                f"the recording lacks rows {first} to {first + count - 1} of the robot"
            )
        return rows

    def close(self) -> None:
        """Closes the worlds; may be called twice."""
        self._stack.close()
