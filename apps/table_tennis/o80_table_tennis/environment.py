"""Gymnasium environments around the arm and its twins.

One step, in both modes, with the arm's iterations as the only clock; k is its newest row used:
1. action => eight pressures, sent for iteration k + 1 + delay (too late: taken at once, counted);
2. real time: wait for row k + 5; accelerated: burst the arm by 5;
3. the arm's rows k + 1 to k + 5 are replayed to every twin, which all burst by 5 at once;
4. the arm's row k + 5 and the twin's row of the same instant => observation, contact, reward.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from .balls.sources import balls_from
from .balls.trajectories import SampledFlight
from .report.episode_record import EpisodeSummary
from .report.logger import EpisodeLogger
from .report.statistics import Statistics, StepCounts, statistics_of
from .rig.ball_records import BallWatch
from .rig.rig import Rig
from .rig.virtual_balls import VirtualBalls
from .settings import ITERATIONS, Pacing, RigSettings, TaskSettings
from .task.actions import MUSCLES, changed_pressures
from .task.observations import PRESSURES, SIZE, Float32Array
from .task.rewards import End

FloatArray = NDArray[np.float64]
Action = NDArray[np.float32]
Info = dict[str, Any]

MOTION = slice(0, PRESSURES.start)
"""Angles, then velocities of the joints in an observation."""
BALL = slice(PRESSURES.stop, SIZE)
"""Position and velocity of the ball in an observation."""
BALL_Y = BALL.start + 1
SEEDS = 2**32
OPTIONS = ("ball", "flight")
"""What `reset` can be told."""
LAST = ITERATIONS - 1


def refuse_wrong_arguments(
    rig: object, task: object, render_mode: str | None, modes: list[str]
) -> None:
    """Raises TypeError or ValueError, saying what to give instead."""
    for name, given, wanted in (("rig", rig, RigSettings), ("task", task, TaskSettings)):
        if given is None or isinstance(given, wanted):
            continue
        fields = given.items() if isinstance(given, dict) else ()
        inside = ", ".join(f"{key}={value!r}" for key, value in fields) or "..."
        raise TypeError(
            f"{name} must be a {wanted.__name__}, got {given!r}: write "
            f"{name}={wanted.__module__}.{wanted.__name__}({inside})"
        )
    if render_mode == "human":
        raise ValueError(
            "there is no render mode 'human': use 'rgb_array', whose render() returns pictures "
            "(gymnasium.wrappers.HumanRendering shows them in a window)"
        )
    if render_mode is not None and render_mode not in modes:
        raise ValueError(f"unknown render mode '{render_mode}'; there are: {', '.join(modes)}")


class TableTennisEnvironment(gymnasium.Env[Float32Array, Action]):
    """Real arm, simulated ball: 100 steps a second of eight pressure changes.

    Actions: Box(-1, 1, (8,)), changes of the normalised pressures. Observations: Box of 22 numbers
    (see `observations`), clipped into named bounds. The reward is paid in the last step.

    `info` holds `hit` (the racket has touched the ball), `smallest_distance` (of the surfaces of
    ball and racket so far [m]), `stalled` (real time: the caller paused for so long that the
    episode was given up), `end` (why the episode ended, "running" before), and with extra balls
    `virtual`: `observations` (N, 22), `rewards` (N,), `hits` (N,), `ended` (N,), and `balls` (N,),
    their numbers.

    `options` of `reset`: `ball`, the number of the ball to be played (else drawn from the seed), or
    `flight`, a SampledFlight of the caller's own. `statistics()` tells rates and lateness.

    Closing it, or leaving its `with` block, ends the arm and the twins that it started.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 100}  # noqa: RUF012

    def __init__(
        self,
        *,
        rig: RigSettings | None = None,
        task: TaskSettings | None = None,
        render_mode: str | None = None,
        camera: str = "side",
        log: Path | None = None,
    ) -> None:
        refuse_wrong_arguments(rig, task, render_mode, self.metadata["render_modes"])
        self.render_mode = render_mode
        self._camera = camera
        self._task = task = task or TaskSettings()
        self._settings = rig or RigSettings()
        self._real_time = self._settings.pacing.real_time
        self._balls = balls_from(task.balls, task.ball_seed, self._settings.period)
        self._open_spaces()

        self._counts = StepCounts()
        self._episode = -1
        self._begun = False
        self._over = True
        self._summary: EpisodeSummary | None = None
        self._scene: Any = None
        self._logger: EpisodeLogger | None = None
        self._rig = Rig(self._settings)
        try:
            self._twin = self._rig.twins[0]
            self._watch = BallWatch(self._twin.record_reader(), end=task.end, reward=task.reward)
            self._virtual = VirtualBalls(self._rig.twins, self._settings, task)
            if log is not None:
                self._logger = EpisodeLogger(
                    log, arm=self._rig.arm.frontend.segment, twin=self._twin.frontend.segment
                )
        except BaseException:
            self.close()
            raise

    def _open_spaces(self) -> None:
        bounds, ranges = self._task.bounds, self._settings.pressures
        self.action_space = spaces.Box(-1.0, 1.0, (MUSCLES,), np.float32)
        self.observation_space = spaces.Box(bounds.low, bounds.high, (SIZE,), np.float32)
        self._low = bounds.low.astype(np.float64)
        self._high = bounds.high.astype(np.float64)
        self._least = np.array(ranges.least, dtype=np.float64)
        self._span = np.array(ranges.most, dtype=np.float64) - self._least
        self._observed = np.empty(SIZE)

    # ------------------------------------------------------------------ an episode

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Float32Array, Info]:
        """Arm and twins to the start; the ball flies from the first step on."""
        super().reset(seed=seed)
        numbers, flights = self._choose_balls(options or {})
        arm_seed = int(self.np_random.integers(SEEDS))
        twin_seed = int(self.np_random.integers(SEEDS))

        rig = self._rig
        rig.arm.go_back() if self._real_time else rig.arm.reset(arm_seed)
        for twin in rig.twins:
            twin.reset(twin_seed)
        self._row = rig.arm.read_newest()
        for twin, its_flights in zip(rig.twins, self._virtual.share(flights), strict=True):
            twin.begin(rig.arm.q[LAST], rig.arm.dq[LAST], its_flights)
        rig.burst_twins(1)

        self._twin_row = self._twin_first = self._twin.iteration
        self._asked = (rig.arm.asked - self._least) / self._span
        self._ball, self._steps = numbers[0], 0
        self._begun, self._over, self._summary = False, False, None
        self._episode += 1
        self._virtual.begin(numbers[1:])
        observation = self._observe()
        self._watch.look(self._twin.row, observation[BALL_Y], 0)
        return observation, self._info(observation, End.RUNNING)

    def step(self, action: Action) -> tuple[Float32Array, float, bool, bool, Info]:
        """Five iterations of the arm and of every twin; see the module for their order."""
        if self._over:
            state = "the episode is over" if self._episode >= 0 else "no episode has begun"
            raise gymnasium.error.ResetNeeded(f"{state}: call reset() before step()")
        if not self._begun:
            self._begin()
        called = time.perf_counter()
        rig, arm, row = self._rig, self._rig.arm, self._row
        if self._real_time and arm.newest - row > self._task.most_late:
            return self._stall()

        # action => pressures => rows of the arm => the twins
        self._asked = changed_pressures(self._asked, action, factor=self._task.factor)
        np.rint(self._least + self._asked * self._span, out=arm.pressures)
        exact = arm.step(row + 1, row + 1 + self._task.delay)
        rig.step_twins()

        self._row = row + ITERATIONS
        self._count(exact=exact)
        self._steps += 1
        observation = self._observe()
        end = self._watch.look(self._twin.row, self._ball_y, self._steps)
        info = self._info(observation, end)
        self._counts.seconds_stepping += time.perf_counter() - called
        if end is End.RUNNING:
            return observation, 0.0, False, False, info
        return observation, self._finish(end.value), end.terminated, end.truncated, info

    def _begin(self) -> None:
        """The first step: an episode begins with it, however long the caller took to think."""
        self._begun = True
        self._first_step_at = time.monotonic()
        if self._real_time:
            self._row = self._rig.arm.newest
        self._arm_first = self._row

    def _stall(self) -> tuple[Float32Array, float, bool, bool, Info]:
        """The arm has moved on too far: what the twin would see is no longer what happens."""
        self._counts.stalled_episodes += 1
        self._finish("stalled", reward=0.0)
        info = {
            "hit": self._watch.hit,
            "smallest_distance": self._watch.smallest_distance,
            "stalled": True,
            "end": "stalled",
        }
        return self._observe(), 0.0, False, True, info

    def _finish(self, end: str, reward: float | None = None) -> float:
        """The episode is over: its reward, its summary, its record."""
        self._over = True
        self._counts.episodes += 1
        self._counts.seconds += time.monotonic() - self._first_step_at
        if reward is None:
            reward = self._watch.reward(self._ball_y)
        self._summary = EpisodeSummary(
            episode=self._episode,
            ball=self._ball,
            steps=self._steps,
            reward=float(reward),
            hit=self._watch.hit,
            returned=self._watch.returned,
            end=end,
            arm_first=self._arm_first,
            arm_last=self._row,
            twin_first=self._twin_first,
            twin_last=self._twin_row,
        )
        if self._logger is not None:
            self._logger.add(self._summary)
        return float(reward)

    def _choose_balls(self, options: Mapping[str, Any]) -> tuple[list[int], list[SampledFlight]]:
        """Numbers and flights: of the ball that is played, then of the extra ones."""
        unknown = [name for name in options if name not in OPTIONS]
        if unknown:
            raise ValueError(
                f"unknown options: {', '.join(unknown)}; reset knows {', '.join(OPTIONS)}"
            )
        drawn = self.np_random.integers(len(self._balls), size=1 + self._settings.extra_balls)
        numbers = [int(number) for number in drawn]
        if "flight" in options:
            flight = options["flight"]
            if not np.isclose(flight.period, self._settings.period):
                raise ValueError(
                    f"a flight in steps of {flight.period} s cannot be played every "
                    f"{self._settings.period} s: resample it"
                )
            numbers[0] = -1
            flights = [flight]
        else:
            numbers[0] = int(options.get("ball", numbers[0]))
            flights = [self._balls.flight(numbers[0])]
        return numbers, flights + [self._balls.flight(number) for number in numbers[1:]]

    # ------------------------------------------------------------------ rows => what is returned

    def _observe(self) -> Float32Array:
        """The newest rows of the arm and of the first twin, clipped; a fresh array."""
        arm, twin, observed = self._rig.arm, self._twin, self._observed
        observed[MOTION] = arm.last_motion
        observed[PRESSURES] = (arm.last_pressures - self._least) / self._span
        observed[BALL] = twin.row[twin.played_ball]
        self._ball_y = float(observed[BALL_Y])
        return np.minimum(np.maximum(observed, self._low), self._high).astype(np.float32)

    def _info(self, observation: Float32Array, end: End) -> Info:
        info: Info = {
            "hit": self._watch.hit,
            "smallest_distance": self._watch.smallest_distance,
            "stalled": False,
            "end": end.value,
        }
        if self._settings.extra_balls:
            info["virtual"] = self._virtual.look(
                observation, steps=self._steps, over=end is not End.RUNNING
            )
        return info

    def _count(self, *, exact: bool) -> None:
        """Whether the step was exact, by the numbers of the iterations, and how late it was.

        `exact`: for the arm, it was.
        """
        counts, arm, twin_row = self._counts, self._rig.arm, self._twin.iteration
        counts.steps += 1
        counts.exact_steps += exact and twin_row == self._twin_row + ITERATIONS
        self._twin_row = twin_row
        if self._real_time:
            lateness = arm.newest - self._row
            counts.summed_lateness += lateness
            counts.largest_lateness = max(counts.largest_lateness, lateness)
            counts.late_actions += arm.late

    # ------------------------------------------------------------------ beside the episode

    @property
    def summary(self) -> EpisodeSummary:
        """Of the episode that has just ended."""
        if self._summary is None:
            raise RuntimeError("there is no summary yet: the episode is not over")
        return self._summary

    @property
    def rig(self) -> Rig:
        """Arm and twins, to be watched."""
        return self._rig

    def statistics(self) -> Statistics:
        """Rates and lateness since the environment was made."""
        return statistics_of(self._counts, self._rig.arm.frontend, step=self._settings.step)

    def render(self) -> Any:
        """A picture (480, 640, 3) of arm and balls as they were last published."""
        if self.render_mode is None:
            gymnasium.logger.warn("no render mode was chosen: make it with render_mode='rgb_array'")
            return None
        if self._scene is None:
            from .report.rendering import Scene

            self._scene = Scene(balls=1 + self._settings.extra_balls)
        return self._scene.draw(
            self._twin.joint_positions(self._twin.row),
            self._virtual.positions(),
            camera=self._camera,
        )

    def close(self) -> None:
        """Ends everything that was started; may be called twice."""
        if self._logger is not None:
            self._logger.close()
        if self._scene is not None:
            self._scene.close()
            self._scene = None
        self._rig.close()


def _paced(rig: RigSettings | None, pacing: Pacing) -> RigSettings:
    """The settings with this pacing. Raises TypeError for what are no settings."""
    refuse_wrong_arguments(rig, None, None, [])
    return (rig or RigSettings()).paced(pacing)


def accelerated_environment(
    *,
    processes: bool = False,
    rig: RigSettings | None = None,
    task: TaskSettings | None = None,
    **rest: Any,
) -> TableTennisEnvironment:
    """`o80/TableTennis-v0`: inline, or with arm and twins in processes of their own."""
    pacing = Pacing.PROCESSES if processes else Pacing.INLINE
    return TableTennisEnvironment(rig=_paced(rig, pacing), task=task, **rest)


def real_time_environment(
    *, rig: RigSettings | None = None, task: TaskSettings | None = None, **rest: Any
) -> TableTennisEnvironment:
    """`o80/TableTennisRealTime-v0`: the arm runs by the clock."""
    settings = _paced(rig, Pacing.REAL_TIME)
    return TableTennisEnvironment(rig=settings, task=task, **rest)
