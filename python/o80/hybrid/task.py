"""A task on a robot and the world that mirrors it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np
from gymnasium import Space, spaces
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv
from numpy.typing import NDArray

from o80.base.argument_checks import number, whole
from o80.base.errors import InvalidArgument
from o80.base.loop_options import did_you_mean
from o80.base.words import RowsWord
from o80.frontend.frontend import Frontend
from o80.hybrid.copies import Copies
from o80.hybrid.endings import Endings
from o80.hybrid.environment import HybridEnvironment
from o80.hybrid.flags import Flags
from o80.hybrid.plan import Plan
from o80.hybrid.recorded import Recorded
from o80.hybrid.rig import AnyRobot, Rig
from o80.hybrid.rig import attach as attached
from o80.hybrid.single import Pacing, Single, Tolerances
from o80.hybrid.starts import Home
from o80.hybrid.worlds import Counts
from o80.learning.batches import rows
from o80.learning.task import EVERY, Index, Outcome, Task
from o80.learning.vector_environment import VectorEnvironment
from o80.recording.reader import RecordedSegment

PACINGS = ("inline", "processes", "real_time")


class HybridTask(Task):
    """A task on a robot and the world that mirrors it; a derived class defines it.

    A step runs in this order; k is the newest row of the robot that was used. The action acts from
    iteration k + 1 + `delay` on; the robot makes the rows k + 1 to k + `every`; the world mirrors
    exactly these rows; the task reads the last row of both.

    A class sets `rig` and `action_space`, or its objects do so before `super().__init__`, and
    defines `begin`, `targets` and `judge`. Its other attributes without an underscore are
    parameters: `make(Push, reach=0.1)` sets `reach`.
    """

    rig: Rig
    """Robot and world, which are stepped together."""
    title: str = ""
    """Name of the task in recordings and data sets; empty: the name of the class."""
    action_space: Space[Any]
    robot_numbers: Sequence[str] = ()
    """Paths in a row of the robot; `observe` returns these numbers first."""
    world_numbers: Sequence[str] = ()
    """Paths in a row of the world; `observe` returns these numbers next."""
    flags: Sequence[str] = ()
    """Comparisons such as "world.extended.puck_speed < 0.01": `judge` gets the copies for which one
    is true in the newest rows; without flags it gets all copies."""
    max_steps: int | None = None
    """Steps after which an episode is truncated."""
    chunk_size: int | None = None
    """Rows of an action that is a chunk, for `every` iterations each; None: one target."""
    action_steps: int = 1
    """Rows of a chunk that are used in one step."""
    profile: RowsWord = "smooth"
    """Profile of the motion between rows of a chunk: "smooth", "monotone", "linear" or "hold"."""
    max_late: int = 25
    """In real time: rows by which the robot may be ahead at the begin of a step [rows]."""
    max_drift: float = 0.2
    """In real time: sum of skipped periods in an episode [s]."""
    max_missed: int = 10
    """Consecutive rows without a reading (see `Mirror.fresh`)."""
    home: Sequence[float] | None = None
    """Targets of all actuators where episodes begin; None: where the robot starts."""
    home_duration: float = 2.0
    """Time of the motion home of a robot that is moved between episodes [s]."""
    home_tolerance: float = 0.05
    """Largest distance from home after this motion, in the units of the robot."""
    home_rest: float = 0.3
    """Time that a robot which is moved between episodes rests at home before one begins [s]."""

    def __init__(
        self,
        copies: int = 1,
        *,
        pacing: Pacing = "inline",
        robot: AnyRobot | None = None,
        robot_options: Mapping[str, Any] | None = None,
        attach: str | None = None,
        world: Any = None,
        worlds: int | None = None,
        recorded: RecordedSegment | None = None,
        resume: bool = False,
        threads: int | None = None,
        **parameters: Any,
    ) -> None:
        """copies: number of copies, inline; or 1.

        pacing: "inline" in this process, "processes" in bursting processes, "real_time" by the
            robot's clock.
        robot, robot_options: replace those of the rig.
        attach: segment of a robot that runs already, with this `pacing`.
        world, worlds: replace those of the rig: `o80.hybrid.attach(segment)` is a world that runs
            already, such as a tracker.
        recorded: a robot in a recording; only the worlds are started, see `relive`.
        resume: in real time a reset ends halts that the robot caused itself; if False, it raises.
        threads: threads that step copies, the calling one included (None: one per processor).
        parameters: attributes of the class.

        Raises InvalidArgument for options that do not fit, DriverError if a robot fails.
        """
        self._set(parameters)
        rig = self._rig_with(robot, robot_options)
        rig = rig if world is None else replace(rig, world=world)
        rig = rig if worlds is None else replace(rig, worlds=worlds)
        rig = rig if recorded is None else replace(rig, end="all")
        count = whole(copies, "copies", 1)
        if pacing not in PACINGS:
            raise InvalidArgument(f"pacing must be one of {', '.join(PACINGS)}, got {pacing!r}")
        if count > 1 and pacing != "inline":
            raise InvalidArgument(
                f"{count} copies are inline: robots in processes or in real time are one "
                f"environment each, o80.hybrid.make(..., pacing='{pacing}')"
            )
        if isinstance(rig.world, attached) and (
            pacing == "inline" or recorded is not None or (rig.worlds or 1) > 1
        ):
            raise InvalidArgument(
                f"world '{rig.world.segment}' runs in another process: only one robot that is not "
                "inline can have it, as its only world: pacing='real_time' or pacing='processes'"
            )
        if threads is not None and pacing != "inline":
            raise InvalidArgument("threads step copies inline: leave them out of other pacings")
        if attach is not None and pacing == "inline":
            raise InvalidArgument("attach is for pacing='real_time' or 'processes'")
        for name in ("home_duration", "home_tolerance", "home_rest"):
            if not 0 <= (value := number(getattr(self, name), name)) < math.inf:
                raise InvalidArgument(f"{name} must be a finite number of at least 0, got {value}")
        plan = Plan(rig, folder_of(type(self)), self.chunk_size, self.action_steps, self.profile)
        home = Home(self.home, self.home_duration, self.home_tolerance)
        tolerances = Tolerances(self.max_late, self.max_drift, self.max_missed)
        self.engine: Copies | Single | Recorded
        if recorded is not None:
            self.engine = Recorded(plan, recorded)
        elif pacing == "inline" and (count > 1 or threads is not None):
            self.engine = Copies(plan, home, count, threads)
        else:
            self.engine = Single(plan, home, pacing, attach, tolerances)
        try:
            self._set_up(count, rig, pacing, resume)
        except BaseException:
            self.engine.close()
            raise

    @classmethod
    def _parameters(cls) -> set[str]:
        return {
            name
            for each in cls.__mro__[: cls.__mro__.index(HybridTask) + 1]
            for name, value in vars(each).items()
            if not (name.startswith("_") or callable(value) or name in ("rig", "action_space"))
        }

    def _set(self, parameters: Mapping[str, Any]) -> None:
        known = self._parameters()
        for name, value in parameters.items():
            if name not in known:
                near = did_you_mean(name, sorted(known))
                raise InvalidArgument(f"{type(self).__name__} has no parameter '{name}'{near}")
            setattr(self, name, value)

    def _rig_with(self, robot: AnyRobot | None, options: Mapping[str, Any] | None) -> Rig:
        rig = getattr(self, "rig", None)
        if not isinstance(rig, Rig):
            raise InvalidArgument(f"{type(self).__name__}.rig must be an o80.hybrid.Rig")
        rig = rig.beside(folder_of(type(self)))
        if robot is not None:
            rig = replace(rig, robot=robot, robot_options=options or {})
        elif options is not None:
            rig = replace(rig, robot_options={**rig.robot_options, **options})
        return rig

    def _set_up(self, copies: int, rig: Rig, pacing: Pacing, resume: bool) -> None:
        engine = self.engine
        self.robots = engine.members
        self.resumes = pacing != "real_time" or resume
        self.period = engine.period
        """Period of the robot [s]."""
        self.robot, self.world = engine.robot, engine.world
        self.generators: list[np.random.Generator] = [np.random.default_rng(0)] * copies
        """(copies,) true while an episode runs."""
        self._clocked = pacing == "real_time"
        chunk = () if self.chunk_size is None else (self.chunk_size,)
        self._target_shape = *chunk, len(self.robot.schema["actuators"])
        self.copies, self.steps = copies, np.zeros(copies, np.int64)
        self.worlds = rig.worlds or 1
        """Worlds of each copy."""
        self._endings = Endings(copies, rig.worlds, rig.end) if rig.worlds else None
        self._numbers = (
            self.robot.numbers(self.robot_numbers),
            self.world.numbers(self.world_numbers),
        )
        self._flags = Flags(self.flags, self.robot, self.world)
        if not isinstance(getattr(self, "action_space", None), Space):
            raise InvalidArgument(f"{type(self).__name__}.action_space must be a Gymnasium space")
        self.prepare()
        space = getattr(self, "observation_space", None)
        if space is None:
            shape, first = np.shape(self.observe(EVERY)), self._first_axes
            if len(shape) <= len(first) or shape[: len(first)] != first:
                wanted = "copies, worlds" if rig.worlds else "copies"
                raise InvalidArgument(
                    f"{type(self).__name__}.observe must return the shape ({wanted}, numbers) "
                    f"with {wanted} = {', '.join(map(str, first))}, got {shape}"
                )
            space = spaces.Box(-np.inf, np.inf, shape[len(first) :], np.float32)
        super().__init__(
            copies,
            observation_space=space,
            action_space=self._actions(self.action_space),
            max_steps=self.max_steps,
        )

    @property
    def _first_axes(self) -> tuple[int, ...]:
        """Returns the leading axes of observations."""
        return (self.copies,) if self._endings is None else (self.copies, self.worlds)

    def _actions(self, space: Space[Any]) -> Space[Any]:
        """Returns the space of actions; chunks have their rows first."""
        if self.chunk_size is None or not isinstance(space, spaces.Box):
            return space
        low, high = (np.stack([each] * self.chunk_size) for each in (space.low, space.high))
        return spaces.Box(low, high, dtype=space.dtype.type)

    @classmethod
    def make_vec(
        cls,
        copies: int,
        *,
        autoreset_mode: AutoresetMode | str,
        record: str | Path | None = None,
        **options: Any,
    ) -> VectorEnv[Any, Any, Any]:
        """Makes environments for training and evaluation; with `record` (see `make`) one copy."""
        if record is None:
            return make_vec(cls, copies, autoreset_mode=autoreset_mode, **options)
        if copies != 1:
            raise InvalidArgument(f"record is for one copy, got {copies}: add --copies 1")
        mode = AutoresetMode(autoreset_mode)
        return SyncVectorEnv([lambda: make(cls, record=record, **options)], autoreset_mode=mode)

    # ------------------------------------------------------------------ what a class defines

    def prepare(self) -> None:
        """Makes the arrays (copies, ...) of the task; called once, after the rig was opened."""

    def targets(self, actions: Any, copies: Index) -> Any:
        """Returns targets (n, actuators) of the robots, or with chunks (n, rows, actuators).

        By default these are the actions themselves, clipped into the action space.
        """
        return self.clipped(actions)

    def observe(self, copies: Index) -> Any:
        """Reads (n, numbers) float32: `robot_numbers`, `world_numbers`; or (n, worlds, numbers)."""
        robot, world = (each.read(copies) for each in self._numbers)
        if self._endings is not None:
            robot = np.repeat(robot[:, np.newaxis], self.worlds, axis=1)
        return np.concatenate([robot, world], -1, dtype=np.float32)

    def action_of(self, rows: NDArray[Any]) -> Any:
        """Returns the action of a step, from the rows of a robot recorded without actions."""
        raise InvalidArgument(
            f"the recording has no actions: define {type(self).__name__}.action_of(rows)"
        )

    def go_home(self, robot: Frontend) -> None:
        """Moves a robot that runs in real time, or serves no reset, to the start of an episode.

        By default to `home`, else to the desired states of its first row. Raises NotReached.
        """
        robot.move_to(
            None,
            self.engine.first if self.home is None else self.home,
            duration=self.home_duration,
            mode="overwrite",
            tolerance=self.home_tolerance,
            timeout=self.home_duration + 20.0,
        )
        rest = round(self.home_rest / robot.period)
        if robot.bursting:
            robot.burst(max(rest, 1))
        else:
            robot.wait_for(robot.published + rest, timeout=self.home_rest + 20.0)

    # ------------------------------------------------------------------ what environments call

    def restart(
        self,
        copies: NDArray[np.intp],
        generators: Sequence[np.random.Generator],
        options: dict[str, Any],
    ) -> None:
        """Resets robots and worlds, calls `begin`, and runs an iteration of each world."""
        if not isinstance(self.engine, Recorded) and (
            self._clocked or (self.home is None and not self.engine.resets)
        ):
            for copy in copies.tolist():
                self.go_home(self.engine.frontend(copy))
        drawn = [each.integers(0, 2**31, 2) for each in generators]
        self.engine.reset(copies, [(int(pair[0]), int(pair[1])) for pair in drawn])
        for copy, generator in zip(copies.tolist(), generators, strict=True):
            self.generators[copy] = generator
        if self._endings is not None:
            self._endings.begin(copies)
        self.engine.mirror(copies)
        self.begin(copies, generators, options)
        self.engine.mirror(copies)

    def step(self, actions: Any, copies: Index) -> None:
        """Runs one step of these copies."""
        targets = self.targets(actions, copies)
        wanted = (len(actions), *self._target_shape)
        if np.shape(targets) != wanted:
            raise InvalidArgument(
                f"{type(self).__name__}.targets must return the shape {wanted}, got "
                f"{np.shape(targets)}"
            )
        if self._endings is not None:
            self._endings.step(copies)
        self.engine.step(targets, copies, self.until_halted)

    def flagged(self) -> NDArray[np.bool_]:
        """Returns (copies,) with a flag true in any world; all copies if there are no flags."""
        if not len(self._flags) or self.engine.stalled:
            return np.ones(self.copies, np.bool_)
        one = np.ones((self.copies, 1), np.bool_)
        return self._flags.raised(one if self._endings is None else self._endings.running)

    def outcome(self, copies: NDArray[np.intp]) -> Outcome:
        """Returns the outcome by `judge`, or the end of an episode that the clock has ended."""
        if self.engine.stalled:
            outcome = Outcome(truncated=True, info={"stalled": [self.engine.stalled]})
        else:
            outcome = self.judge(copies)
        if self._endings is None:
            return outcome
        halted = np.isin(copies, [*self.halts])
        late = self.steps[copies] >= (self.max_steps or np.inf)
        return self._endings.take(copies, outcome, halted, late)

    def shown(self, copies: Index) -> tuple[Any, Mapping[str, Any]]:
        """Returns observations of the first worlds; info `worlds` has the observations of all."""
        observed, info = super().shown(copies)
        if self._endings is None:
            return observed, info
        worlds = {name: values[copies] for name, values in self._endings.arrays.items()}
        if isinstance(self.observation_space, spaces.Box):
            observed = np.asarray(observed, self.observation_space.dtype)
        shown = {"observation": observed} | worlds
        return rows(observed, (slice(None), 0)), {**info, "worlds": shown}

    def info(self, copies: Index) -> Mapping[str, Any]:
        """Returns `moved` in real time: whether the robot moved between reset and first step."""
        return {"moved": [self.engine.moved]} if self._clocked else {}

    def statistics(self) -> Counts:
        """Returns the counts since the task was made."""
        return self.engine.counts

    def close(self) -> None:
        """Closes robots and worlds that the task started; may be called twice."""
        self.engine.close()


def folder_of(cls: type) -> Path:
    """Returns the folder of the file with a task; the working folder for interactive code."""
    for each in cls.__mro__[: cls.__mro__.index(HybridTask)]:
        for value in vars(each).values():
            if isinstance(value, FunctionType):
                file = Path(value.__code__.co_filename)
                return file.resolve().parent if file.exists() else Path.cwd()
    return Path.cwd()


def make(
    task: type[HybridTask],
    *,
    record: str | Path | None = None,
    render_mode: str | None = None,
    **options: Any,
) -> HybridEnvironment:
    """Makes one environment of a task.

    record: a file (NAME.mcap) for all rows of robot and world, with marks of the episodes. An
        existing file is continued.
    render_mode: a render mode of the task.
    options: of the task, see `HybridTask`: `pacing="real_time"`, among others.
    """
    made = _checked(task)(1, **options)
    try:
        return HybridEnvironment(made, render_mode=render_mode, record=record, options=options)
    except BaseException:
        made.close()
        raise


def make_vec(
    task: type[HybridTask],
    copies: int,
    *,
    autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
    render_mode: str | None = None,
    **options: Any,
) -> VectorEnvironment:
    """Makes environments of `copies` copies, which threads of C++ step together.

    autoreset_mode: when the next episode of a copy begins, see `o80.learning.VectorEnvironment`.
    options: of the task, see `HybridTask`.
    """
    made = _checked(task)(copies, **options)
    try:
        return VectorEnvironment(made, autoreset_mode=autoreset_mode, render_mode=render_mode)
    except BaseException:
        made.close()
        raise


def _checked(task: Any) -> type[HybridTask]:
    if isinstance(task, type) and issubclass(task, HybridTask):
        return task
    raise InvalidArgument(f"task must be a class derived from o80.hybrid.HybridTask, got {task!r}")
