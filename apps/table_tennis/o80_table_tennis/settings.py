"""Settings of rig and task: frozen values with the published defaults."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from numbers import Real

from o80.base.argument_checks import whole

from .task.actions import FINE, largest_change
from .task.ball_play import ReturnTask, SmashTask, missing_members, observes_as_published
from .task.end import EndRule
from .task.full_observation import FullObservation, full_observation
from .task.noise import NO_NOISE, NoiseSettings
from .task.observations import ObservationBounds
from .task.observer import Observer
from .task.rewards import RewardRule, reward_rule
from .world.arm import MUSCLES
from .world.timing import ITERATIONS, PERIOD


class Pacing(Enum):
    """How arm and twins run."""

    REAL_TIME = "real time"
    """The arm by its own clock in its own process, each twin bursting in its own process."""
    PROCESSES = "processes"
    """Arm and twins all bursting, each in its own process."""
    INLINE = "inline"
    """Arm and twins all bursting, in the caller's process."""

    @property
    def real_time(self) -> bool:
        """The arm has a clock of its own."""
        return self is Pacing.REAL_TIME


@dataclass(frozen=True)
class RigSettings:
    """The arm and its worlds. Raises ValueError or TypeError."""

    pacing: Pacing = Pacing.INLINE
    arm_segment: str | None = None
    """Name of the arm's segment; None: an unused one."""
    attach: bool = False
    """The arm runs already, in another process, as `arm_segment`: only the world is started."""
    twin_segment: str | None = None
    """The world runs already, bursting, in another process under this name; None: it is started
    too. `rig.rig.world_options` has its options."""
    worlds: int | None = None
    """Worlds that mirror the arm, each with a ball of its own; the ball of the first one is played.
    None: one."""
    preset: str = "standard"
    """Numbers of the simulated arm: standard, identified (as the real arm) or published_simulation.
    The default policy is made for the standard ones."""
    muscle: str = "of_preset"
    """Model of the muscles of the simulated arm, instead of the preset's: linear or hill."""
    ranges: str = "of_preset"
    """Pressure ranges of the arm, instead of the preset's: simulated or real."""
    start_noise: float = 0.0
    """On each joint of the simulated arm at a reset, uniform in plus or minus this [rad]."""
    frequency: float = 1.0 / PERIOD
    """Frequency of arm and worlds [1/s]."""
    history: int | None = None
    """Rows that arm and worlds keep; None: as many as fit into o80's usual history, of copies a few
    steps."""

    def __post_init__(self) -> None:
        if self.pacing not in tuple(Pacing):
            there_are = ", ".join(str(each) for each in Pacing)
            raise TypeError(f"pacing must be one of {there_are}, got {self.pacing!r}")
        if self.worlds is not None:
            whole(self.worlds, "worlds", 1)
        if not (math.isfinite(self.frequency) and self.frequency > 0):
            raise ValueError(f"frequency must be a positive number [1/s], got {self.frequency}")
        if self.attach and self.arm_segment is None:
            raise ValueError("to attach to an arm, give the name of its segment: arm_segment")

    @property
    def period(self) -> float:
        """Duration of an iteration [s]."""
        return 1.0 / self.frequency

    @property
    def step(self) -> float:
        """Duration of a step of the environment [s]."""
        return ITERATIONS * self.period


@dataclass(frozen=True)
class TaskSettings:
    """The task, its balls and its rules. Raises ValueError or TypeError.

    A delay or a chunk that o80.hybrid cannot have is refused when an environment is made.
    """

    task: str | ReturnTask = "return"
    """return or smash; or an object of your own, see `task.ball_play.ReturnTask`."""
    balls: str | None = None
    """Simulated shots: "narrow" (like those of the recorded ball gun), "wide", or "launcher" (those
    of the ball launcher, needs o80-devices). Or the path of a recording, or of a folder of them.
    None: narrow."""
    ball_seed: int = 0
    """Seed of the simulated shots: each seed has its own."""
    ball_count: int | None = None
    """How many simulated shots there are; None: no end of them, each episode draws a new one."""
    factor: float = FINE
    """Factor of the actions: 0.05 fine, 1 coarse."""
    repeat: int = 1
    """How often an action is carried out, for 10 ms each time, before the next observation."""
    chunk_size: int | None = None
    """Rows of an action chunk: an action is (chunk_size, 8), each row carried out like an action
    (8,), one after the other, in iterations of its own. None: single actions (8,)."""
    action_steps: int = 1
    """Rows of a chunk that are over when the policy sees again; the others act if it is late."""
    delay: int = 1
    """Iterations the policy has to think, real time: an action acts from row k + 1 + delay."""
    observation: str | FullObservation = "published"
    """published (22 numbers), or full: with what was asked lately and a filtered ball, see
    `task.full_observation`; the latter of tasks without an `observe` of their own."""
    noise: NoiseSettings = NO_NOISE
    """Noise of the observations; `NoiseSettings.tracker()` is that of a real camera system."""
    bounds: ObservationBounds = field(default_factory=ObservationBounds)
    """Bounds of the published observation of the named tasks."""
    end: EndRule = field(default_factory=EndRule)
    """End of an episode of the named tasks."""
    reward: str | RewardRule = "ordered"
    """Reward of the named tasks: ordered, published, or a rule of `task.rewards`."""
    fly_out: bool = False
    """After the first touch nobody is asked any more: in the same step the ball flies to its end,
    and the episode ends. A second touch of the racket then does not happen."""
    max_late: int = 20
    """Rows of lateness, with chunks beyond their last row, above which an episode is given up as
    stalled, real time."""

    def __post_init__(self) -> None:
        for name in ("delay", "ball_seed", "max_late"):
            whole(getattr(self, name), name, 0)
        whole(self.repeat, "repeat", 1)
        whole(self.action_steps, "action_steps", 1)
        if self.chunk_size is not None:
            whole(self.chunk_size, "chunk_size", 1)
        if self.ball_count is not None:
            whole(self.ball_count, "ball_count", 1)
        factor: object = self.factor
        if not isinstance(factor, Real) or not 0 < float(factor) < math.inf:
            raise ValueError(f"factor must be a positive number, got {factor!r}")
        reward_rule(self.reward)
        full_observation(self.observation)
        noise: object = self.noise
        if not isinstance(noise, NoiseSettings):
            raise TypeError(f"noise must be NoiseSettings, got {noise!r}")
        task: object = self.task
        if isinstance(self.task, str):
            if self.task not in TASKS:
                raise ValueError(f"unknown task '{self.task}'; there are: {', '.join(TASKS)}")
        elif isinstance(task, type) and not missing_members(task):
            raise TypeError(f"task must be an object: write {task.__name__}()")
        elif missing := missing_members(self.task):
            raise TypeError(
                f"task must be one of {', '.join(TASKS)}, or an object with the members of "
                f"o80_table_tennis.task.ball_play.ReturnTask; {self.task!r} has no "
                f"{', '.join(missing)}"
            )
        if self.observation != "published" and not observes_as_published(self.made()):
            raise ValueError(
                f"{type(self.task).__name__} has an `observe` of its own, which observation="
                f"{self.observation!r} would replace: give observation='published', or leave out "
                "`observe`"
            )

    @property
    def action_shape(self) -> tuple[int, ...]:
        """Shape of an action."""
        return (MUSCLES,) if self.chunk_size is None else (self.chunk_size, MUSCLES)

    @property
    def steps(self) -> int:
        """Steps of 10 ms from one observation to the next."""
        return self.repeat * self.action_steps

    @property
    def planned(self) -> int:
        """Iterations after an observation for which the chunk before it has rows."""
        if self.chunk_size is None:
            return 0
        return self.delay + ITERATIONS * (self.chunk_size * self.repeat - self.steps)

    def observer(self, task: ReturnTask, step: float, count: int) -> Observer:
        """Observer of `count` episodes, whose steps without repetition take `step` [s]."""
        return Observer(
            task,
            count,
            noise=self.noise,
            full=full_observation(self.observation),
            interval=self.steps * step,
            largest_change=self.steps * largest_change(self.factor),
        )

    def start_of(self, rig: RigSettings) -> RigSettings:
        """The rig, whose arm starts as the noise of this task says."""
        posture = self.noise.start_posture
        return replace(rig, start_noise=posture) if posture > 0 else rig

    @property
    def title(self) -> str:
        """Name of the task."""
        return self.task if isinstance(self.task, str) else type(self.task).__name__

    def made(self) -> ReturnTask:
        """The task itself."""
        return TASKS[self.task](self) if isinstance(self.task, str) else self.task


TASKS: Mapping[str, Callable[[TaskSettings], ReturnTask]] = {
    "return": lambda s: ReturnTask(s.bounds, s.end, reward_rule(s.reward)),
    "smash": lambda s: SmashTask(s.bounds, s.end, reward_rule(s.reward)),
}
"""The tasks with a name."""
