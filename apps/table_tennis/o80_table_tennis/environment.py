"""Gymnasium environment of one arm and its worlds; `copies` describes a step."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.hybrid.environment import HybridEnvironment

from .arguments import refuse_wrong_arguments
from .copies import TableTennisCopies
from .report.display import RENDER_MODES, Page
from .report.episode_summary import EpisodeSummary
from .report.recorded_episodes import mark_episode, settings_mark
from .report.statistics import EpisodeCounts, Statistics, statistics_of
from .settings import RigSettings, TaskSettings
from .task.end import End

Action = NDArray[np.float32]
Info = dict[str, Any]
Outcome = tuple[NDArray[np.float32], float, bool, bool, Info]


class TableTennisEnvironment(HybridEnvironment):
    """Real arm, simulated ball: 100 steps a second of eight pressure changes, or fewer longer ones.

    Actions: Box(-1, 1, (8,)), changes of the normalised pressures; with `chunk_size=n`, chunks
    Box(-1, 1, (n, 8)). The task (`TaskSettings.task`) defines observation, reward and its part of
    `info`. The environment adds `stalled`, `end` (a number of `End`), `end_text`, and with
    `RigSettings(worlds=n)` the results of each ball, `worlds`. The README has the details.

    `options` of `reset`: `ball`, the number of the ball (else drawn from the seed), or
    `flight`, a SampledFlight.

    `record="run.mcap"` records every row of arm and worlds, and marks the episodes; an existing
    file is continued. `report.recorded_episodes` reads it, see also `o80.open`.
    """

    metadata: dict[str, Any] = {"render_modes": RENDER_MODES, "render_fps": 100}  # noqa: RUF012
    task: TableTennisCopies
    _page: Page | None
    _summary: EpisodeSummary | None

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
        self.task = made = TableTennisCopies(None, rig=rig, task=task, camera=camera)
        self._page, its_rig = None, made.rig_settings
        self.arm, *self.twins = frontends = made.single.frontends
        """Frontends of the arm, and of the worlds; the first world's ball is played."""
        self._counts = EpisodeCounts()
        self._number, self._summary = -1, None
        try:
            mark_values = settings_mark(its_rig, made.settings, [each.epoch for each in frontends])
            super().__init__(made, record=record, options=mark_values)
            self.metadata, self.render_mode = type(self).metadata, render_mode
            if render_mode == "human":
                step = 0.0 if its_rig.pacing.real_time else its_rig.step
                self._page = Page([*self.twins, self.arm], step)
        except BaseException:
            self.close()
            raise

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], Info]:
        """Resets arm and worlds; the ball flies from the first step on."""
        observation, info = super().reset(seed=seed, options=options)
        self._twin_first, self._number = self.task.twin_row, self._number + 1
        self._paid, self._begun_at = 0.0, math.nan
        self._summary, self._observed = None, [observation.copy()]
        return observation, info

    def step(self, action: Action) -> Outcome:
        """Runs five iterations of arm and worlds, times `repeat`, times `action_steps`."""
        called = time.monotonic()
        observation, reward, terminated, truncated, info = super().step(action)
        if math.isnan(self._begun_at):  # an episode begins with its first step
            self._begun_at = called
        end = End(info["end"])
        self._paid += reward
        if self.recording is not None and end is not End.STALLED:
            self._observed.append(observation.copy())
        self._counts.seconds_stepping += time.monotonic() - called
        if self._page is not None:
            self._page.after_step()
        if end is not End.RUNNING:
            self._finish(end)
        return observation, reward, terminated, truncated, info

    def _finish(self, end: End) -> None:
        """Summarises an ended episode, and marks it in the recording."""
        self._counts.episodes += 1
        self._counts.stalled_episodes += end is End.STALLED
        self._counts.seconds += time.monotonic() - self._begun_at
        task, draw = self.task, self.task.draws[0]
        _, first, last = task.single.span
        self._summary = EpisodeSummary.of(
            task.state.record.at(0),
            number=self._number,
            ball=draw.numbers[0],
            steps=int(task.steps[0]),
            reward=self._paid,
            terminated=end.terminated,
            end=end.text,
            arm_first=first,
            arm_last=last,
            twin_first=self._twin_first,
            twin_last=task.twin_row,
        )
        if self.recording is not None:
            mark_episode(
                self.recording,
                self._summary,
                self._observed,
                goal=draw.goal,
                extra_balls=draw.numbers[1:],
                arm_seed=draw.arm_seed,
                twin_seed=draw.twin_seed,
            )

    # ------------------------------------------------------------------ beside the episode

    @property
    def summary(self) -> EpisodeSummary:
        """Summary of the last episode."""
        if self._summary is None:
            raise RuntimeError("there is no summary yet: the episode is not over")
        return self._summary

    def statistics(self) -> Statistics:
        """Rates and lateness since the environment was made."""
        task = self.task
        step, rows, of_rig = task.rig_settings.step, task.action_steps, task.statistics()
        return statistics_of(self._counts, of_rig, self.arm, step_seconds=step, rows=rows)

    def render(self) -> Any:
        """Draws the newest rows: (480, 640, 3) for `rgb_array`; None for `human`, see `Page`."""
        return None if self._page is not None else super().render()

    def close(self) -> None:
        """Ends all started processes and recordings; may be called twice."""
        try:
            if self._page is not None:
                self._page.close()
        finally:
            super().close()
