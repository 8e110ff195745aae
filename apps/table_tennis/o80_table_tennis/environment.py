"""The Gymnasium environment of one arm and its worlds, see `copies` for what a step does."""

from __future__ import annotations

import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from o80.learning import Environment

from .arguments import refuse_wrong_arguments
from .copies import TableTennisCopies
from .report.display import RENDER_MODES, Page
from .report.episode_recorder import EpisodeRecorder
from .report.episode_summary import EpisodeSummary
from .report.statistics import EpisodeCounts, Statistics, statistics_of
from .settings import RigSettings, TaskSettings
from .task.end import End

Action = NDArray[np.float32]
Info = dict[str, Any]
Outcome = tuple[NDArray[np.float32], float, bool, bool, Info]


class TableTennisEnvironment(Environment):
    """Real arm, simulated ball: 100 steps a second of eight pressure changes, or fewer longer ones.

    Actions: Box(-1, 1, (8,)), changes of the normalised pressures. The task (`TaskSettings.task`)
    defines observation and reward. By default observations are a Box of 22 numbers (see
    `task.observations`), clipped into named bounds, and the reward is paid in the last step.

    With `TaskSettings(chunk_size=n, action_steps=m, delay=d)` an action is a chunk, Box(-1, 1,
    (n, 8)), of a policy that thinks for up to d iterations of 2 ms. Row j changes the pressures of
    the row before it. It acts in the five iterations (with `repeat` in as many times five) from
    k + 1 + d + 5 j on, k that of the observation, in no other ones. A step takes m rows; the next
    chunk goes on from row m - 1, the other rows act only while it is late.

    `info` holds the entries of the task (with a ball `touched`, `returned`, `landing`, `distance`,
    see `task.outcome`, and `smallest_distance` of the surfaces of ball and racket so far [m]),
    `stalled` (real time: the caller paused for so long that the episode was given up), `end` (why
    the episode ended, a number of `End`) and its `end_text`, and with `RigSettings(worlds=n)` what
    is shown of each ball: `worlds`.

    `options` of `reset`: `ball`, the number of the ball to be played (else drawn from the seed), or
    `flight`, a SampledFlight of the caller's own. `statistics()` tells rates and lateness.

    `record="run.mcap"` records every row of arm and worlds, and marks the episodes; a file that
    exists is continued. `report.recorded_episodes` reads it, see also `o80.open`.

    Closing it, or leaving its `with` block, ends the arm and the worlds that it started.
    """

    metadata: dict[str, Any] = {"render_modes": RENDER_MODES, "render_fps": 100}  # noqa: RUF012
    task: TableTennisCopies

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
        super().__init__(TableTennisCopies(None, rig=rig, task=task, camera=camera))
        self.metadata, self.render_mode = type(self).metadata, render_mode
        self.arm, *self.twins = self.task.single.frontends
        """Frontends of the arm, and of the worlds; the ball of the first one is played."""
        self._counts = EpisodeCounts()
        self._number = -1
        self._begun = False
        self._summary: EpisodeSummary | None = None
        self._page: Page | None = None
        self._recorder: EpisodeRecorder | None = None
        its_rig = self.task.rig_settings
        try:
            if render_mode == "human":
                shown, by_clock = [*self.twins, self.arm], its_rig.pacing.real_time
                self._page = Page(shown, 0.0 if by_clock else its_rig.step)
            if record is not None:
                recorded = [self.arm, *self.twins]
                self._recorder = EpisodeRecorder(
                    Path(record), recorded, its_rig, self.task.settings
                )
        except BaseException:
            self.close()
            raise

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], Info]:
        """Arm and worlds to the start; the ball flies from the first step on."""
        observation, info = super().reset(seed=seed, options=options)
        self._draw, self._twin_first = self.task.draws[0], self.task.twin_row
        self._paid, self._number = 0.0, self._number + 1
        self._begun, self._summary = False, None
        self._first_observation = observation.copy()
        return observation, _plain(info)

    def step(self, action: Action) -> Outcome:
        """Five iterations of the arm and of every world, times `repeat`, times `action_steps`."""
        if not self._ready:
            state = "the episode is over" if self._number >= 0 else "no episode has begun"
            raise gymnasium.error.ResetNeeded(f"{state}: call reset() before step()")
        if not self._begun:
            self._begin()
        called = time.perf_counter()
        observation, reward, terminated, truncated, info = super().step(action)
        end = End(info["end"])
        info = _plain(info)
        self._paid += reward
        if self._recorder is not None and end is not End.STALLED:
            self._recorder.step(action, reward, observation)
        self._counts.seconds_stepping += time.perf_counter() - called
        if self._page is not None:
            self._page.after_step()
        if end is not End.RUNNING:
            self._finish(end)
        return observation, reward, terminated, truncated, info

    def _begin(self) -> None:
        """The first step: an episode begins with it, however long the caller took to think."""
        self._begun, draw = True, self._draw
        if self._recorder is not None:
            self._recorder.begin(
                self._first_observation,
                number=self._number,
                ball=draw.balls.numbers[0],
                extra_balls=draw.balls.numbers[1:],
                goal=draw.goal,
                seed=self.np_random_seed,
                arm_seed=draw.arm_seed,
                twin_seed=draw.twin_seed,
            )
        self._first_step_at = time.monotonic()

    def _finish(self, end: End) -> None:
        """The episode is over: its summary, its mark in the recording."""
        self._counts.episodes += 1
        self._counts.stalled_episodes += end is End.STALLED
        self._counts.seconds += time.monotonic() - self._first_step_at
        task = self.task
        _, first, last = task.single.span
        self._summary = EpisodeSummary.of(
            task.state.record.at(0),
            number=self._number,
            ball=self._draw.balls.numbers[0],
            steps=int(task.steps[0]),
            reward=self._paid,
            terminated=end.terminated,
            end=end.text,
            arm_first=first,
            arm_last=last,
            twin_first=self._twin_first,
            twin_last=task.twin_row,
        )
        if self._recorder is not None:
            self._recorder.end(self._summary)

    # ------------------------------------------------------------------ beside the episode

    @property
    def summary(self) -> EpisodeSummary:
        """Summary of the episode that has just ended."""
        if self._summary is None:
            raise RuntimeError("there is no summary yet: the episode is not over")
        return self._summary

    def statistics(self) -> Statistics:
        """Rates and lateness since the environment was made."""
        task = self.task
        rows = 1 if task.chunk_size is None else task.action_steps
        step = task.rig_settings.step
        return statistics_of(
            self._counts, task.statistics(), self.arm, step_seconds=step, rows=rows
        )

    def render(self) -> Any:
        """`rgb_array`: a picture (480, 640, 3) of the newest rows; `human`: None, see `Page`."""
        return None if self._page is not None else super().render()

    def close(self) -> None:
        """Ends everything that was started; may be called twice."""
        with ExitStack() as stack:  # each is closed even if another one fails
            stack.callback(super().close)
            for part in (self._page, self._recorder):
                if part is not None:
                    stack.callback(part.close)


def _plain(info: Info) -> Info:
    """Info with plain numbers."""
    return {
        name: value.item() if isinstance(value, np.generic) else value
        for name, value in info.items()
    }
