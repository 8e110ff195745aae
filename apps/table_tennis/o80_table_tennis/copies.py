"""Table tennis in N copies, as a task of o80.learning; `environment` has the single one.

One step, as that of an accelerated single environment, for all copies at once:
1. actions => eight pressures of each arm; 2. all arms burst by 5; 3. the rows of the arms are
replayed to the twins, which all burst by 5; 4. rows => observations, contacts, rewards.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from o80.learning import EVERY, Index, Outcome, Task

from .arguments import refuse_unless_for_copies, refuse_wrong_balls, refuse_wrong_options
from .balls.sources import balls_from
from .episode_draw import drawn_episode
from .report.rendering import Scene
from .rig.group_rig import GroupRig
from .settings import RigSettings, TaskSettings
from .task.actions import changed_pressures
from .task.end import End, terminated, undecided
from .task.observer import Observer
from .task.state import State
from .world.arm import MUSCLES
from .world.timing import ITERATIONS

FloatArray = NDArray[np.float64]
Numbers = NDArray[np.intp]

TEXTS = np.array([end.text for end in End], object)
"""Texts of the ends, by their numbers."""


def _running(copies: int) -> dict[str, NDArray[Any]]:
    """Entries of `info` where no episode has ended."""
    ends = np.full(copies, End.RUNNING, np.int64)
    return {"stalled": np.zeros(copies, np.bool_), "end": ends, "end_text": TEXTS[ends]}


class TableTennisCopies(Task):
    """N arms with simulated balls, stepped together by threads of C++."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 100}  # noqa: RUF012

    def __init__(
        self,
        copies: int,
        *,
        rig: RigSettings | None = None,
        task: TaskSettings | None = None,
        threads: int | None = None,
        camera: str = "side",
    ) -> None:
        """threads: that step them, the calling one included (None: one for each processor)."""
        settings, rig = task or TaskSettings(), rig or RigSettings()
        refuse_unless_for_copies(rig)
        self._task = settings.made()
        refuse_wrong_balls(rig, settings, plays_ball=self._task.plays_ball)
        self._fly_out, self._passed_y = settings.fly_out, settings.end.passed_y
        rig = settings.start_of(rig)
        self._observer = Observer(self._task, settings.observing(rig.step), copies)
        super().__init__(
            copies,
            observation_space=self._observer.space,
            action_space=spaces.Box(-1.0, 1.0, (MUSCLES,), np.float32),
        )
        self._factor, self._repeat = settings.factor, settings.repeat
        self._period, self._camera = rig.period, camera
        self._balls = balls_from(
            settings.balls, settings.ball_seed, rig.period, settings.ball_count
        )
        self._rig = GroupRig(copies, rig, delay=settings.delay, threads=threads)
        arms, twins = self._rig.arms, self._rig.twins
        self._asked = arms.asked(EVERY)
        pressures = np.zeros((copies, MUSCLES))
        self._ends = np.zeros(copies, np.int64)
        self._state = State(
            self.steps,
            arms.last_motion,
            pressures,
            arms.last_racket,
            twins.ball,
            twins.records,
            np.zeros((copies, *np.shape(self._task.begin(np.random.default_rng(0))))),
        )
        self._scene: Scene | None = None
        self._observations = np.zeros((copies, self._observer.size), np.float32)
        self._unobserved = False
        self._gathered: list[NDArray[np.float32]] = []
        if self._observer.is_ball_play:
            self._gathered = self._rig.gather(self._observer.low, self._observer.high)
        self._running = _running(copies)
        self._some_ended = False

    def begin(
        self,
        copies: Numbers,
        generators: Sequence[np.random.Generator],
        options: Mapping[str, Any],
    ) -> None:
        """Arms and twins to the start, with a drawn ball, or that of `options`."""
        plays = self._task.plays_ball
        refuse_wrong_options(options, plays_ball=plays, period=self._period)
        draws = [
            drawn_episode(self._task, self._balls, generator, options=options)
            for generator in generators
        ]
        self._rig.reset(
            copies,
            arm_seeds=[draw.arm_seed for draw in draws],
            twin_seeds=[draw.twin_seed for draw in draws],
            flights=[draw.balls.flights[0] if plays else None for draw in draws],
        )
        self._asked[copies] = self._rig.arms.asked(copies)
        self._state.goal[copies] = [draw.goal for draw in draws]
        self._ends[copies] = End.RUNNING
        self._look()
        if not self._gathered:
            state, asked = self._state.at(copies), self._asked[copies]
            self._observations[copies] = self._observer.begin(state, asked, generators, copies)
        self._unobserved = False

    def step(self, actions: Any, copies: Index) -> None:
        """`repeat` times five iterations of these arms and of their twins."""
        asked = self._asked[copies]
        for _ in range(self._repeat):
            asked = changed_pressures(asked, actions, factor=self._factor)
            self._rig.step(asked, copies)
        self._asked[copies] = asked
        self._ends[copies], self._some_ended = End.RUNNING, False
        self._look()
        if self._fly_out and np.count_nonzero(self._state.record.touched):
            touched = np.zeros(self.copies, np.bool_)
            touched[copies] = np.asarray(self._state.record.touched)[copies]
            self._fly(np.flatnonzero(touched))
        self._unobserved = True

    def _fly(self, touched: Numbers) -> None:
        """The touched balls of these copies fly to their ends, unless they are there."""
        state = self._state.at(touched)
        flying = touched[undecided(self._task.end(state), state.record.touched)]
        if flying.size:
            self._rig.twins.fly_out(flying, ITERATIONS * self._repeat, self._passed_y)
            self._look()

    def _look(self) -> None:
        """Updates the parts of the state that are no views of the newest rows."""
        self._rig.arms.read_pressures(self._state.pressures)
        self._state.record = self._rig.twins.records

    def flagged(self) -> NDArray[np.bool_]:
        """(copies,) whose episode may have ended, or whose step is paid."""
        flags: NDArray[np.bool_] = self._task.eventful(self._state)
        return flags

    def judge(self, copies: Numbers) -> Outcome:
        """Ends and rewards of these."""
        state = self._state.at(copies)
        ends = self._task.end(state)
        self._ends[copies], self._some_ended = ends, True
        by_event = terminated(ends)
        return Outcome(self._task.reward(state), by_event, ~by_event & (ends != End.RUNNING))

    def observe(self, copies: Index) -> Any:
        """(n, M); those that have been stepped are observed once, when first asked for."""
        if self._gathered:
            if isinstance(copies, slice):
                return np.concatenate(self._gathered, axis=1)
            return np.concatenate([part[copies] for part in self._gathered], axis=1)
        if self._unobserved:
            state, asked = self._of(copies), self._asked[copies]
            self._observations[copies] = self._observer.observe(state, asked, copies)
            self._unobserved = False
        return self._observations[copies]

    def info(self, copies: Index) -> Mapping[str, Any]:
        """As that of the single environment."""
        info = self._task.info(self._of(copies))
        if not self._some_ended and isinstance(copies, slice):
            return info | self._running
        ends = self._ends[copies]
        info["stalled"] = ends == End.STALLED
        info["end"], info["end_text"] = ends, TEXTS[ends]
        return info

    def _of(self, copies: Index) -> State:
        return self._state if isinstance(copies, slice) else self._state.at(copies)

    def render(self, copy: int) -> Any:
        """A picture (480, 640, 3) of one copy."""
        if self._scene is None:
            self._scene = Scene()
        twins = self._rig.twins
        ball = twins.ball[copy, :3]
        return self._scene.draw(twins.joint_positions[copy], ball[None], camera=self._camera)

    def close(self) -> None:
        """Ends arms and twins; may be called twice."""
        self._rig.close()
        if self._scene is not None:
            self._scene.close()
            self._scene = None
