"""Settings of rig and task: frozen dataclasses with the published defaults."""

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
    """Pacing of arm and twins."""

    REAL_TIME = "real time"
    """Arm by its own clock in its own process, each twin bursting in its own process."""
    PROCESSES = "processes"
    """Arm and twins all bursting, each in its own process."""
    INLINE = "inline"
    """Arm and twins all bursting, in the caller's process."""

    @property
    def real_time(self) -> bool:
        """Whether the arm runs by its own clock."""
        return self is Pacing.REAL_TIME


@dataclass(frozen=True)
class RigSettings:
    """Settings of the arm and its worlds. Raises ValueError or TypeError for wrong values."""

    pacing: Pacing = Pacing.INLINE
    arm_segment: str | None = None
    """Name of the arm's segment; None: an unused one."""
    attach: bool = False
    """Attach to the running arm `arm_segment`; only the world is started."""
    twin_segment: str | None = None
    """Name of a running bursting world; None: the world is started.
    `rig.rig.world_options` returns its options."""
    worlds: int | None = None
    """Number of worlds that mirror the arm, each with its own ball; the first one is played.
    None: one."""
    preset: str = "standard"
    """Preset of the simulated arm: standard, identified (real arm) or published_simulation.
    The default policy is tuned for the standard arm."""
    muscle: str = "of_preset"
    """Model of the muscles of the simulated arm, instead of the preset's: linear or hill."""
    ranges: str = "of_preset"
    """Pressure ranges of the arm, instead of the preset's: simulated or real."""
    start_noise: float = 0.0
    """Largest deviation of each simulated joint at a reset, either way, uniform [rad]."""
    frequency: float = 1.0 / PERIOD
    """Frequency of arm and worlds [1/s]."""
    history: int | None = None
    """Number of rows in the histories; None: as many as fit into o80's usual history, a few steps
    for copies."""

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
    """Settings of task, balls and rules. Raises ValueError or TypeError for wrong values.

    A delay or chunk that o80.hybrid does not support is refused when an environment is made.
    """

    task: str | ReturnTask = "return"
    """return, smash, or your own object, see `task.ball_play.ReturnTask`."""
    balls: str | None = None
    """Simulated shots: "narrow" (like the recorded ball gun's), "wide", or "launcher" (needs
    o80-devices). Or the path of a recording, or of a folder of recordings.
    None: narrow."""
    ball_seed: int = 0
    """Seed of the simulated shots."""
    ball_count: int | None = None
    """Number of simulated shots; None: unlimited, each episode draws a new one."""
    factor: float = FINE
    """Factor of the actions: 0.05 fine, 1 coarse."""
    repeat: int = 1
    """Number of times an action is executed, for 10 ms each, before the next observation."""
    chunk_size: int | None = None
    """Number of rows of an action chunk (chunk_size, 8); each row is executed like an action
    (8,), in its own iterations. None: single actions (8,)."""
    action_steps: int = 1
    """Chunk rows before the next observation; the others act if the policy is late."""
    delay: int = 1
    """Iterations for the policy's computation, real time: an action acts from row k + 1 + delay."""
    observation: str | FullObservation = "published"
    """published (22 numbers), or full: with recent commands and a filtered ball, see
    `task.full_observation`; full is for tasks without their own `observe`."""
    noise: NoiseSettings = NO_NOISE
    """Noise of the observations; `NoiseSettings.tracker()`: noise of a real camera system."""
    bounds: ObservationBounds = field(default_factory=ObservationBounds)
    """Bounds of the published observation of the named tasks."""
    end: EndRule = field(default_factory=EndRule)
    """End of an episode of the named tasks."""
    reward: str | RewardRule = "ordered"
    """Reward of the named tasks: ordered, published, or an object as in `task.rewards`."""
    fly_out: bool = False
    """After the first touch, no more actions: the ball flies to its end in the same step,
    and the episode ends, without a second touch of the racket."""
    max_late: int = 20
    """Largest lateness in rows (with chunks: beyond their last row), above which an episode has
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
        """Number of steps of 10 ms between observations."""
        return self.repeat * self.action_steps

    @property
    def planned(self) -> int:
        """Number of iterations after an observation for which the previous chunk has rows."""
        if self.chunk_size is None:
            return 0
        return self.delay + ITERATIONS * (self.chunk_size * self.repeat - self.steps)

    def observer(self, task: ReturnTask, step: float, count: int) -> Observer:
        """Makes the observer of `count` episodes. step: duration without repetition [s]."""
        return Observer(
            task,
            count,
            noise=self.noise,
            full=full_observation(self.observation),
            interval=self.steps * step,
            largest_change=self.steps * largest_change(self.factor),
        )

    def start_of(self, rig: RigSettings) -> RigSettings:
        """Returns the rig with the start noise of this task."""
        posture = self.noise.start_posture
        return replace(rig, start_noise=posture) if posture > 0 else rig

    @property
    def title(self) -> str:
        """Name of the task."""
        return self.task if isinstance(self.task, str) else type(self.task).__name__

    def made(self) -> ReturnTask:
        """Makes the task."""
        return TASKS[self.task](self) if isinstance(self.task, str) else self.task


TASKS: Mapping[str, Callable[[TaskSettings], ReturnTask]] = {
    "return": lambda s: ReturnTask(s.bounds, s.end, reward_rule(s.reward)),
    "smash": lambda s: SmashTask(s.bounds, s.end, reward_rule(s.reward)),
}
"""Named tasks."""
