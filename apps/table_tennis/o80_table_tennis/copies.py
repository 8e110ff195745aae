"""Table tennis as a task of o80.learning: one copy on a `Rig`, or N copies on a `GroupRig`.

One step, with the arm's iterations as the only clock; k is its newest row used:
1. actions => eight pressures of each arm, sent for iteration k + 1 + delay (by the clock, too late:
   taken at once, counted); with chunks row j for the five iterations from k + 1 + delay + 5 j on
   (too late: skipped, counted);
2. by the clock: wait for row k + 5; else all arms burst by 5;
3. the arm's rows k + 1 to k + 5 are replayed to its twins, which all burst by 5 at once;
4. the arm's row k + 5 and the twin's row of the same instant => observation, contact, reward.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from o80.base.arrays import FloatArray
from o80.learning import EVERY, Index, Outcome, Task
from o80.learning.halts import halts_of
from o80.view.pictures import Pictures

from .arguments import refuse_unless_for_copies, refuse_wrong_balls, refuse_wrong_options
from .balls.sources import balls_from
from .episode_draw import EpisodeDraw, drawn_episode
from .rig.group_rig import GroupRig
from .rig.rig import Rig
from .settings import RigSettings, TaskSettings
from .task.actions import changed_pressures
from .task.end import End, terminated, undecided
from .task.observer import Observer
from .task.state import State
from .world.arm import MUSCLES
from .world.timing import ITERATIONS

Numbers = NDArray[np.intp]

SIZE = (640, 480)
"""Width and height of pictures [pixels]."""
TEXTS = np.array([end.text for end in End], object)
"""Texts of the ends, by their numbers."""


def _running(copies: int) -> dict[str, NDArray[Any]]:
    """Entries of `info` where no episode has ended."""
    ends = np.full(copies, End.RUNNING, np.int64)
    return {"stalled": np.zeros(copies, np.bool_), "end": ends, "end_text": TEXTS[ends]}


class TableTennisCopies(Task):
    """Arms with simulated balls, stepped together."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 100}  # noqa: RUF012

    def __init__(
        self,
        copies: int | None,
        *,
        rig: RigSettings | None = None,
        task: TaskSettings | None = None,
        threads: int | None = None,
        camera: str = "side",
    ) -> None:
        """copies: N of them, inline; None: one, as `rig` says.

        threads: that step N copies, the calling one included (None: one for each processor).
        """
        settings, rig = task or TaskSettings(), rig or RigSettings()
        if copies is not None:
            refuse_unless_for_copies(rig, settings)
        self.settings, self.task = settings, settings.made()
        refuse_wrong_balls(rig, settings)
        rig = settings.start_of(rig)
        self.observer = Observer(self.task, settings.observing(rig.step), copies or 1)
        """Observer that makes observations of states."""
        super().__init__(
            copies or 1,
            observation_space=self.observer.space,
            action_space=spaces.Box(-1.0, 1.0, settings.action_shape, np.float32),
        )
        self._rig_settings, self._camera = rig, camera
        self._balls = balls_from(
            settings.balls, settings.ball_seed, rig.period, settings.ball_count
        )
        self._gathered: list[NDArray[np.float32]] = []
        if copies is None:
            self.rig: Rig | GroupRig = Rig(
                rig, delay=settings.delay, chunks=settings.chunk_size is not None
            )
        else:
            group = GroupRig(copies, rig, delay=settings.delay, threads=threads)
            if self.observer.is_ball_play:
                self._gathered = group.gather(self.observer.low, self.observer.high)
            self.rig = group
        self.robots = self.rig.robots
        self._ends = np.zeros(self.copies, np.int64)
        self.state = State(
            self.steps,
            self.rig.arm.last_motion,
            np.zeros((self.copies, MUSCLES)),
            self.rig.arm.commanded(),
            self.rig.arm.last_racket,
            self.rig.twin.ball,
            self.rig.twin.records,
            np.zeros((self.copies, *np.shape(self.task.begin(np.random.default_rng(0))))),
        )
        """(copies, ...) after the last step."""
        self.draws: list[EpisodeDraw] = []
        """Draws of the episodes that were begun last."""
        self._pictures: Pictures | None = None
        self._observations = np.zeros((self.copies, self.observer.size), np.float32)
        self._unobserved = self._stalled = False
        self._running = _running(self.copies)
        self._some_ended = False

    def begin(
        self,
        copies: Numbers,
        generators: Sequence[np.random.Generator],
        options: Mapping[str, Any],
    ) -> None:
        """Arms and twins to the start, with a drawn ball, or that of `options`."""
        rig = self._rig_settings
        refuse_wrong_options(options, period=rig.period)
        self.draws = draws = [
            drawn_episode(self.task, self._balls, each, extra=rig.extra_balls, options=options)
            for each in generators
        ]
        self.rig.reset(
            copies,
            arm_seeds=[draw.arm_seed for draw in draws],
            twin_seeds=[draw.twin_seed for draw in draws],
            flights=[draw.balls.flights for draw in draws],
        )
        self.state.asked[copies] = self.rig.arm.commanded(copies)
        self.state.goal[copies] = [draw.goal for draw in draws]
        self._ends[copies] = End.RUNNING
        self._look()
        if not self._gathered:
            state = self.state.at(copies)
            self._observations[copies] = self.observer.begin(state, generators, copies)
        self._unobserved = self._stalled = False

    def step(self, actions: Any, copies: Index) -> None:
        """`repeat` times five iterations of these arms and of their twins, with chunks for each of
        the `action_steps`.

        Nothing if the arm has moved on too far for the twin to follow: the episode is given up.
        """
        settings, rig = self.settings, self.rig
        self._stalled = rig.lateness > settings.max_late + settings.planned
        if self._stalled:
            return
        asked = self.state.asked[copies]
        if settings.chunk_size is None:
            for _ in range(settings.repeat):
                asked = changed_pressures(asked, actions, factor=settings.factor)
                self._move(asked, copies)
        else:
            asked = self._step_chunk(asked, np.asarray(actions))
        self.state.asked[copies] = asked
        self._ends[copies], self._some_ended = End.RUNNING, False
        self._look()
        if settings.fly_out and np.count_nonzero(self.state.record.touched):
            touched = np.zeros(self.copies, np.bool_)
            touched[copies] = np.asarray(self.state.record.touched)[copies]
            self._fly(np.setdiff1d(np.flatnonzero(touched), [*halts_of(self.robots, self.copies)]))
        self._unobserved = True

    def _move(self, pressures: FloatArray, copies: Index = EVERY, **steps: int) -> None:
        """A step of the rig; arms and twins that a halt ends show their last rows."""
        stepped = False
        with self.until_halted():
            self.rig.step(pressures, copies, **steps)
            stepped = True
        if not stepped:
            self.rig.see_newest()

    def _step_chunk(self, asked: FloatArray, actions: NDArray[Any]) -> FloatArray:
        """Sends a chunk (1, chunk_size, 8); the pressures (1, 8) of its last row that is over when
        the policy sees again: the next chunk changes these.
        """
        settings = self.settings
        rows = []
        for action in np.repeat(actions[0], settings.repeat, axis=0):
            asked = changed_pressures(asked, action[None], factor=settings.factor)
            rows.append(asked)
        self._move(np.concatenate(rows), steps=settings.steps)
        return rows[settings.steps - 1]

    def _fly(self, touched: Numbers) -> None:
        """The touched balls of these copies fly to their ends, unless they are there."""
        state = self.state.at(touched)
        flying = touched[undecided(self.task.end(state), state.record.touched)]
        if flying.size:
            every = ITERATIONS * self.settings.steps
            self.rig.twin.fly_out(flying, every, self.settings.end.passed_y)
            self._look()

    def _look(self) -> None:
        """Updates the parts of the state that are no views of the newest rows."""
        self.rig.arm.read_pressures(self.state.pressures)
        self.state.record = self.rig.twin.records

    def flagged(self) -> NDArray[np.bool_]:
        """(copies,) whose episode may have ended, or whose step is paid."""
        if self._stalled:
            return super().flagged()
        flags: NDArray[np.bool_] = self.task.eventful(self.state)
        return flags

    def judge(self, copies: Numbers) -> Outcome:
        """Ends and rewards of these."""
        self._some_ended = True
        if self._stalled:
            self.steps[copies] -= 1  # nothing was done
            self._ends[copies] = End.STALLED
            return Outcome(truncated=True)
        state = self.state.at(copies)
        ends = self.task.end(state)
        by_event = terminated(ends)
        self._ends[copies] = np.where(np.isin(copies, [*self.halts]), End.HALTED, ends)
        return Outcome(self.task.reward(state), by_event, ~by_event & (ends != End.RUNNING))

    def observe(self, copies: Index) -> Any:
        """(n, M); those that have been stepped are observed once, when first asked for."""
        if self._gathered:
            if isinstance(copies, slice):
                return np.concatenate(self._gathered, axis=1)
            return np.concatenate([part[copies] for part in self._gathered], axis=1)
        if self._unobserved:
            self._observations[copies] = self.observer.observe(self._of(copies), copies)
            self._unobserved = False
        return self._observations[copies]

    def info(self, copies: Index) -> Mapping[str, Any]:
        """Entries of the task, and how the episode stands: see `environment`."""
        info = self.task.info(self._of(copies))
        if not self._some_ended and isinstance(copies, slice):
            return info | self._running
        ends = self._ends[copies]
        info["stalled"] = ends == End.STALLED
        info["end"], info["end_text"] = ends, TEXTS[ends]
        return info

    def _of(self, copies: Index) -> State:
        return self.state if isinstance(copies, slice) else self.state.at(copies)

    def render(self, copy: int) -> Any:
        """A picture (480, 640, 3) of one copy."""
        twin = self.rig.twin_of(copy)
        if self._pictures is None:
            self._pictures = Pictures(twin, size=SIZE, camera=self._camera)
        return self._pictures.draw(twin.latest())

    def close(self) -> None:
        """Ends arms and twins; may be called twice."""
        if self._pictures is not None:
            self._pictures.close()
        self.rig.close()
