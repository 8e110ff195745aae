"""Gymnasium environments around the arm and its twins.

One step, in both modes, with the arm's iterations as the only clock; k is its newest row used:
1. action => eight pressures, sent for iteration k + 1 + delay (too late: taken at once, counted);
2. real time: wait for row k + 5; accelerated: burst the arm by 5;
3. the arm's rows k + 1 to k + 5 are replayed to every twin, which all burst by 5 at once;
4. the arm's row k + 5 and the twin's row of the same instant => observation, contact, reward.
"""

from __future__ import annotations

import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from .arguments import (
    refuse_wrong_arguments,
    refuse_wrong_balls,
    refuse_wrong_options,
)
from .balls.sources import balls_from
from .episode_draw import drawn_episode
from .report.display import RENDER_MODES, Display, display_of
from .report.episode_recorder import EpisodeRecorder
from .report.episode_summary import EpisodeSummary
from .report.statistics import Statistics, StepCounts, statistics_of
from .rig.rig import Rig
from .rig.virtual_balls import VirtualBalls
from .settings import RigSettings, TaskSettings
from .task.actions import changed_pressures
from .task.end import End, undecided
from .task.observer import Observer
from .task.state import State
from .world.arm import MUSCLES
from .world.timing import ITERATIONS

Float32Array = NDArray[np.float32]
FloatArray = NDArray[np.float64]
Action = NDArray[np.float32]
Info = dict[str, Any]
Outcome = tuple[Float32Array, float, bool, bool, Info]


class TableTennisEnvironment(gymnasium.Env[Float32Array, Action]):
    """Real arm, simulated ball: 100 steps a second of eight pressure changes, or fewer longer ones.

    Actions: Box(-1, 1, (8,)), changes of the normalised pressures. The task (`TaskSettings.task`)
    defines observation and reward. By default observations are a Box of 22 numbers (see
    `task.observations`), clipped into named bounds, and the reward is paid in the last step.

    `info` holds the entries of the task (with a ball `touched`, `returned`, `landing`, `distance`,
    see `task.outcome`, and `smallest_distance` of the surfaces of ball and racket so far [m]),
    `stalled` (real time: the caller paused for so long that the episode was given up), `end` (why
    the episode ended, a number of `End`) and its `end_text`, and with extra balls `virtual`, see
    `rig.virtual_balls`.

    `options` of `reset`: `ball`, the number of the ball to be played (else drawn from the seed), or
    `flight`, a SampledFlight of the caller's own. `statistics()` tells rates and lateness.

    `record="run.mcap"` records every row of arm and twins, and marks the episodes; a file that
    exists is continued. `report.recorded_episodes` reads it, see also `o80.open`.

    Closing it, or leaving its `with` block, ends the arm and the twins that it started.
    """

    metadata: dict[str, Any] = {"render_modes": RENDER_MODES, "render_fps": 100}  # noqa: RUF012

    def __init__(
        self,
        *,
        rig: RigSettings | None = None,
        task: TaskSettings | None = None,
        render_mode: str | None = None,
        camera: str = "side",
        record: str | Path | None = None,
    ) -> None:
        refuse_wrong_arguments(rig, task, render_mode, self.metadata["render_modes"])
        self.render_mode = render_mode
        self._settings = task or TaskSettings()
        self._rig_settings = self._settings.start_of(rig or RigSettings())
        self._task = self._settings.made()
        refuse_wrong_balls(self._rig_settings, self._settings, plays_ball=self._task.plays_ball)
        settings = self._settings
        self._balls = balls_from(
            settings.balls, settings.ball_seed, self._rig_settings.period, settings.ball_count
        )
        observing = settings.observing(self._rig_settings.step)
        self._observer = Observer(self._task, observing)
        self.observation_space: spaces.Space[Float32Array] = self._observer.space
        self.action_space = spaces.Box(-1.0, 1.0, (MUSCLES,), np.float32)

        self._real_time = self._rig_settings.pacing.real_time
        self._counts = StepCounts()
        self._episode = -1
        self._begun = False
        self._over = True
        self._summary: EpisodeSummary | None = None
        self._display: Display | None = None
        self._recorder: EpisodeRecorder | None = None
        self._rig = Rig(self._rig_settings)
        try:
            self._arm, self._twin = self._rig.arm, self._rig.twins[0]
            self._virtual = VirtualBalls(self._rig, self._task, observing)
            if render_mode is not None:
                self._display = display_of(
                    self._rig, self._virtual, render_mode=render_mode, camera=camera
                )
            if record is not None:
                self._recorder = EpisodeRecorder(Path(record), self._rig, self._settings)
        except BaseException:
            self.close()
            raise

    # ------------------------------------------------------------------ an episode

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Float32Array, Info]:
        """Arm and twins to the start; the ball flies from the first step on."""
        super().reset(seed=seed)
        options, task = options or {}, self._task
        refuse_wrong_options(options, plays_ball=task.plays_ball, period=self._rig_settings.period)
        extra = self._rig_settings.extra_balls
        draw = drawn_episode(task, self._balls, self.np_random, extra=extra, options=options)
        seeds = {"arm_seed": draw.arm_seed, "twin_seed": draw.twin_seed}
        self._rig.reset(**seeds, flights=self._virtual.share(draw.balls.flights))

        self._drawn = drawn = draw.balls
        self._seeds = {"seed": self.np_random_seed, **seeds}
        self._twin_first = self._rig.twin_row
        self._asked = self._arm.asked
        self._steps, self._paid = 0, 0.0
        self._begun, self._over, self._summary = False, False, None
        self._episode += 1
        arm, twin = self._arm, self._twin
        self._state = state = State(
            0, arm.last_motion, arm.pressures, arm.last_racket, twin.ball, twin.record, draw.goal
        )
        observation = self._observer.begin(state, self._asked, [self.np_random])
        self._virtual.begin(drawn.numbers[1:], state, self._asked, self.np_random)
        self._observation = observation
        self._first_observation = observation.copy()
        return observation, self._info(state, End.RUNNING)

    def step(self, action: Action) -> Outcome:
        """`repeat` times five iterations of the arm and of every twin; order: see the module."""
        if self._over:
            state = "the episode is over" if self._episode >= 0 else "no episode has begun"
            raise gymnasium.error.ResetNeeded(f"{state}: call reset() before step()")
        if not self._begun:
            self._begin()
        called = time.perf_counter()
        rig = self._rig
        if self._real_time and rig.lateness > self._settings.most_late:
            return self._stall()

        for _ in range(self._settings.repeat):
            # action => pressures => rows of the arm => rows of the twins => outcome
            rig.ask(self._changed(action), delay=self._settings.delay)
            rig.step_arm()
            rig.step_twins()
            lateness = rig.lateness if self._real_time else 0
            self._counts.add_step(exact=rig.exact, lateness=lateness, late=self._arm.late)
        return self._outcome(called, action)

    def _begin(self) -> None:
        """The first step: an episode begins with it, however long the caller took to think."""
        self._begun = True
        if self._recorder is not None:
            self._recorder.begin(
                self._first_observation,
                number=self._episode,
                ball=self._drawn.numbers[0],
                extra_balls=self._drawn.numbers[1:],
                goal=self._state.goal,
                **self._seeds,
            )
        self._first_step_at = time.monotonic()
        self._rig.begin()
        self._arm_first = self._rig.row

    def _changed(self, action: Action) -> FloatArray:
        """Normalised pressures (8,) to ask for after an action."""
        self._asked = changed_pressures(self._asked, action, factor=self._settings.factor)
        return self._asked

    def _outcome(self, called: float, action: Action) -> Outcome:
        """The result of a step that began at `called` on the clock [s]."""
        self._steps += 1
        state = self._look()
        settings, touched = self._settings, state.record.touched
        if settings.fly_out and touched and undecided(self._task.end(state), touched):
            self._twin.fly_out(ITERATIONS * settings.repeat, settings.end.passed_y)
            state = self._look()
        observation = self._observation = self._observer.observe(state, self._asked)
        self._virtual.observe(state, self._asked)
        end, reward = End.RUNNING, 0.0
        if self._task.eventful(state):
            end, reward = End(int(self._task.end(state))), float(self._task.reward(state))
        self._paid += reward
        info = self._info(state, end)
        if self._recorder is not None:
            self._recorder.step(action, reward, observation)
        self._counts.seconds_stepping += time.perf_counter() - called
        if self._display is not None:
            self._display.after_step()
        if end is End.RUNNING:
            return observation, reward, False, False, info
        self._finish(end)
        return observation, reward, end.terminated, end.truncated, info

    def _stall(self) -> Outcome:
        """The arm has moved on too far for the twin to follow: the episode is given up."""
        self._counts.stalled_episodes += 1
        self._finish(End.STALLED)
        return self._observation.copy(), 0.0, False, True, self._info(self._state, End.STALLED)

    def _finish(self, end: End) -> None:
        """The episode is over: its summary, its mark in the recording."""
        self._over = True
        self._counts.episodes += 1
        self._counts.seconds += time.monotonic() - self._first_step_at
        self._summary = EpisodeSummary.of(
            self._state.record,
            number=self._episode,
            ball=self._drawn.numbers[0],
            steps=self._steps,
            reward=self._paid,
            terminated=end.terminated,
            end=end.text,
            arm_first=self._arm_first,
            arm_last=self._rig.row,
            twin_first=self._twin_first,
            twin_last=self._rig.twin_row,
        )
        if self._recorder is not None:
            self._recorder.end(self._summary)

    # ------------------------------------------------------------------ rows => observation, info

    def _look(self) -> State:
        """The newest rows of the arm and of the first twin, for the task."""
        state, twin = self._state, self._twin
        state.steps, state.pressures = self._steps, self._arm.pressures
        state.ball, state.record = twin.ball, twin.record
        return state

    def _info(self, state: State, end: End) -> Info:
        info = self._task.info(state)
        info["stalled"] = end is End.STALLED
        info["end"], info["end_text"] = int(end), end.text
        if self._rig_settings.extra_balls:
            info["virtual"] = self._virtual.look(state, over=end is not End.RUNNING)
        return info

    # ------------------------------------------------------------------ beside the episode

    @property
    def summary(self) -> EpisodeSummary:
        """Summary of the episode that has just ended."""
        if self._summary is None:
            raise RuntimeError("there is no summary yet: the episode is not over")
        return self._summary

    @property
    def rig(self) -> Rig:
        """Arm and twins, to be watched."""
        return self._rig

    @property
    def observer(self) -> Observer:
        """Observer that makes observations of states."""
        return self._observer

    def statistics(self) -> Statistics:
        """Rates and lateness since the environment was made."""
        return statistics_of(self._counts, self._rig.arm.frontend, step=self._rig_settings.step)

    def render(self) -> Any:
        """`rgb_array`: a picture (480, 640, 3) of the newest rows; `human`: None, see `Page`."""
        if self._display is not None:
            return self._display.render()
        modes = " or ".join(f"render_mode='{mode}'" for mode in RENDER_MODES)
        gymnasium.logger.warn(f"no render mode was chosen: make it with {modes}")
        return None

    def close(self) -> None:
        """Ends everything that was started; may be called twice."""
        with ExitStack() as stack:  # each is closed even if another one fails
            stack.callback(self._rig.close)
            for part in (self._display, self._recorder):
                if part is not None:
                    stack.callback(part.close)
