"""Table tennis as a task of o80.hybrid: one arm with any pacing, or N copies inline.

A step is that of a HybridTask, of five iterations: actions become eight pressures of each arm; of a
chunk, row j is for the five iterations from k + 1 + delay + 5 j on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

import o80
from o80.base.arrays import Float32Array, FloatArray
from o80.hybrid import EVERY, HybridTask, Index, Outcome
from o80.hybrid.single import Single
from o80.learning.halts import halts_of
from o80.rows.layout import with_padding
from o80.view.pictures import Pictures

from .arguments import refuse_unless_for_copies, refuse_wrong_balls, refuse_wrong_options
from .balls.sources import balls_from
from .episode_draw import EpisodeDraw, drawn_episode
from .rig.ball_records import fly_out_fields
from .rig.home import Home
from .rig.rig import rig_of
from .rig.rows import RigRows
from .settings import RigSettings, TaskSettings
from .task.actions import changed_pressures
from .task.end import End, terminated
from .task.state import State
from .world.arm import JOINTS, MUSCLES
from .world.timing import ITERATIONS

Numbers = NDArray[np.intp]

PICTURE = (640, 480)
"""Width and height of pictures [pixels]."""
TEXTS = np.array([end.text for end in End], object)
"""Texts of `End`, by number."""
BALL_STATE = np.dtype([(name, np.float64, (3,)) for name in ("position", "velocity", "spin")])
"""State of a ball, as sent to a world."""


class TableTennisCopies(HybridTask):
    """Arms with simulated balls, stepped together.

    With `RigSettings(worlds=n)`, n balls fly beside each arm, each in its own world; arrays of
    all balls begin with the worlds of copy 0.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 100}  # noqa: RUF012
    profile = "hold"
    max_drift = math.inf

    def __init__(
        self,
        copies: int | None,
        *,
        rig: RigSettings | None = None,
        task: TaskSettings | None = None,
        threads: int | None = None,
        camera: str = "side",
    ) -> None:
        """copies: N inline copies; None: one arm with the pacing of `rig`.

        threads: number of threads that step, the caller included (None: one for each processor).
        """
        settings, rig = task or TaskSettings(), rig or RigSettings()
        if copies is not None:
            refuse_unless_for_copies(rig, settings)
        refuse_wrong_balls(rig, settings)
        rig = settings.start_of(rig)
        self.settings, self.rig_settings, self.task = settings, rig, settings.made()
        self.title = settings.title
        count, each = copies or 1, rig.worlds or 1
        self.observer = settings.observer(self.task, rig.step, count * each)
        """Observer: converts states to observations."""
        self.observation_space = self.observer.space
        self.action_space = spaces.Box(-1.0, 1.0, (MUSCLES,), np.float32)
        self.rig = rig_of(rig, delay=settings.delay, group=copies is not None or each > 1)
        self.max_late = settings.max_late + settings.planned
        self.action_steps = settings.action_steps
        if settings.chunk_size is not None:
            self.chunk_size = settings.chunk_size * settings.repeat
            self.action_steps = settings.steps
        self._balls = balls_from(
            settings.balls, settings.ball_seed, rig.period, settings.ball_count
        )
        self._camera = camera
        self._pictures: Pictures | None = None
        pacing: Any = rig.pacing.name.lower()  # name in o80.hybrid
        super().__init__(
            count,
            pacing=pacing,
            attach=rig.arm_segment if rig.attach else None,
            threads=1 if copies == 1 else threads,
        )
        try:
            self._create_views()
        except BaseException:
            self.close()
            raise
        self.action_space = spaces.Box(-1.0, 1.0, settings.action_shape, np.float32)

    def _create_views(self) -> None:
        """Creates named views of the rows, and the arrays of the task."""
        engine: Any = self.engine
        arms, self._worlds = engine.members
        self.arm: o80.Frontend = engine.frontend(0)
        """Frontend of the first arm."""
        self.rows = RigRows(self.robot.last, self.world.last, self.arm, self.world_of(0))
        """Newest rows, with names."""
        self.range, self.home_of_arm = self.rows.range, Home(self.arm)
        self._gathered: list[Float32Array] = []
        self._launch: o80.GroupBurst | None = None
        if isinstance(arms, o80.InlineGroup) and self.worlds == 1:
            self._launch = self._worlds.prepared_burst(1, [*range(JOINTS + 1)])  # and the ball
            bounds = self.observer.low, self.observer.high
            plays = self.observer.is_ball_play
            self._gathered = self.rows.gather(arms, self._worlds, bounds if plays else None)
        self._asked, self._pressures = np.zeros((2, self.copies, MUSCLES))
        goal = np.shape(self.task.begin(np.random.default_rng(0)))
        total = self.copies * self.worlds
        self.state = State(
            self.steps,
            self.rows.motion,
            self._pressures,
            self._asked,
            self.rows.racket,
            self.rows.balls,
            self.rows.read_records(),
            np.zeros((total, *goal)),
        )
        """State of all balls after the last step."""
        self.draws: list[EpisodeDraw] = []
        """Draws of the episodes of the last `restart`."""
        self.twin_row = 0
        """Last used iteration of the first world."""
        self.returns_at_reset = True
        """Whether a reset in real time first brings the arm back; False: the caller does."""
        self.after_step: Callable[[], None] | None = None
        """Called after each step of 10 ms, with the newest rows of arm and world."""
        self._observations = np.zeros((total, self.observer.size), np.float32)
        self._ends = np.zeros(total, np.int64)
        self._unobserved = self._some_ended = False
        ends, nobody = np.full(self.copies, End.RUNNING), np.zeros(self.copies, np.bool_)
        self._running = {"stalled": nobody, "end": ends, "end_text": TEXTS[ends]}

    @property
    def single(self) -> Single:
        """Engine of one arm."""
        assert isinstance(self.engine, Single)
        return self.engine

    def world_of(self, copy: int, world: int = 0) -> o80.Frontend:
        """Frontend of a world of a copy."""
        member: o80.InlineGroup | o80.Frontend = self._worlds
        if isinstance(member, o80.Frontend):
            return member
        return member[copy * self.worlds + world]

    # ------------------------------------------------------------------ episodes

    def restart(
        self,
        copies: Numbers,
        generators: Sequence[np.random.Generator],
        options: Mapping[str, Any],
    ) -> None:
        """Resets arms and worlds, with drawn balls, or with the ball of `options`."""
        refuse_wrong_options(options, period=self.rig_settings.period)
        more = {"extra": self.worlds - 1, **options}
        self.draws = draws = [
            drawn_episode(self.task, self._balls, rng, **more) for rng in generators
        ]
        if self._clocked and self.returns_at_reset:
            self.home_of_arm.go()
        self.engine.reset(copies, [(draw.arm_seed, draw.twin_seed) for draw in draws])
        if self._endings is not None:
            self._endings.begin(copies)
        if self._launch is None or any(len(each.flights[0].positions) > 1 for each in draws):
            self.begin(copies, generators, options)
            self.engine.mirror(copies)
        else:
            self._launch_balls(copies, self._launch)
        self.twin_row = self.rows.iteration.item()
        self._asked[copies] = self.commanded(copies)
        balls = np.arange(len(self._ends))[self._balls_of(copies)]
        self.state.goal[balls] = [draw.goal for draw in draws for _ in range(self.worlds)]
        self._ends[balls] = End.RUNNING
        self._update_state()
        if not self._gathered:
            seeds = [each for each in generators for _ in range(self.worlds)]
            state = self.state.at(balls)
            self._observations[balls] = self.observer.begin(state, seeds, balls)
        self._unobserved = False

    def begin(
        self,
        copies: Numbers,
        generators: Sequence[np.random.Generator],
        options: Mapping[str, Any],
    ) -> None:
        """Sends the balls, which fly from the next iteration on."""
        for copy, draw in zip(copies.tolist(), self.draws, strict=True):
            for number, flight in enumerate(draw.flights):
                world, states = self.world_of(copy, number), flight.states.view(BALL_STATE)[:, 0]
                if len(states) == 1:  # the common case, ten times as fast
                    world.add_command(self.rows.ball, states[0], iterations=1)
                else:
                    world.add_trajectory(states, self.rows.ball)
                world.pulse()

    def _launch_balls(self, copies: Numbers, launch: o80.GroupBurst) -> None:
        """Does the same as `begin` and `mirror`, in one call."""
        numbers = launch.targets.view(np.float64).reshape(self.copies, -1)
        joints, motion = numbers[:, : 2 * JOINTS], self.rows.motion[copies]
        joints[copies, ::2], joints[copies, 1::2] = motion[:, :JOINTS], motion[:, JOINTS:]
        numbers[copies, 2 * JOINTS :] = [draw.flights[0].states[0] for draw in self.draws]
        launch.run(copies)
        self.world.show(copies, with_padding(launch.rows)[copies, np.newaxis])

    def commanded(self, copies: Index = EVERY) -> FloatArray:
        """Normalised desired pressures (n, 8) of the last rows, a fresh array."""
        return self.range.normalised(self.rows.desired[copies])

    # ------------------------------------------------------------------ steps

    def step(self, actions: Any, copies: Index) -> None:
        """Runs five iterations of these arms and worlds for each played action, `repeat` times.

        Does nothing if the arm is too far ahead for the world to follow: the episode has stalled.
        """
        settings, asked = self.settings, self._asked[copies]
        if self._endings is not None:
            self._endings.step(copies)
        if settings.chunk_size is None:
            for _ in range(settings.repeat):
                asked = changed_pressures(asked, actions, factor=settings.factor)
                self._move(self.range.raw(asked), copies)
                if self.engine.stalled:
                    return
        else:
            rows = []
            for action in np.repeat(np.asarray(actions)[0], settings.repeat, axis=0):
                asked = changed_pressures(asked, action[None], factor=settings.factor)
                rows.append(asked)
            self._move(self.range.raw(np.stack(rows, 1)), copies)
            if self.engine.stalled:
                return
            asked = rows[settings.steps - 1]  # the next chunk continues from here
        self._asked[copies] = asked
        self._ends[self._balls_of(copies)], self._some_ended = End.RUNNING, False
        self._update_state()
        if settings.fly_out and np.count_nonzero(self.state.record.touched):
            touched = np.zeros(self.copies, np.bool_)
            touched[copies] = np.asarray(self.state.record.touched)[copies]
            self._fly(np.setdiff1d(np.flatnonzero(touched), [*halts_of(self.robots, self.copies)]))
        self._unobserved = True

    def _move(self, targets: FloatArray | None, copies: Index) -> None:
        """Runs a step of the rig; targets None: sends nothing."""
        self.engine.step(targets, copies, self.until_halted)
        self.twin_row = self.rows.iteration.item()
        if self.after_step is not None and not self.engine.stalled:
            self.after_step()

    def idle(self) -> None:
        """Runs 10 ms of the arm's clock without commands."""
        if self.single.stalled or self.single.lateness > self.max_late:
            self.single.begin()
        self._move(None, EVERY)

    def _fly(self, touched: Numbers) -> None:
        """Lets the touched balls of these copies fly to the end, unless their episodes are over."""
        state = self.state.at(touched)
        flying = touched[state.record.touched & ~terminated(self.task.end(state))]
        if flying.size:
            every = ITERATIONS * self.settings.steps
            fields = fly_out_fields(every=every, passed_y=self.settings.end.passed_y)
            self.world.request("fly_out", flying, **fields)
            self.engine.mirror(flying)
            self._update_state()

    def _update_state(self) -> None:
        """Updates the parts of the state that are not views of the newest rows."""
        self.range.normalised(self.rows.observed, out=self._pressures)
        state, rows = self.state, self.rows
        state.record = rows.read_records()
        if self.worlds > 1:
            of_arm = (self.steps, rows.motion, self._pressures, self._asked, rows.racket)
            each: list[Any] = [np.repeat(part, self.worlds, axis=0) for part in of_arm]
            state.steps, state.motion, state.pressures, state.asked, state.racket = each

    def _balls_of(self, copies: Index) -> Index:
        """Indices of these copies' balls."""
        if self.worlds == 1:
            return copies
        numbers = np.arange(self.copies * self.worlds).reshape(self.copies, self.worlds)
        return numbers[copies].ravel()

    def _of(self, copies: Index) -> State:
        return self.state if isinstance(copies, slice) else self.state.at(self._balls_of(copies))

    def _by_world(self, values: Any) -> Any:
        """Reshapes values of balls (n * worlds, ...) to (n, worlds, ...) for several worlds."""
        if self._endings is None:
            return values
        return np.reshape(values, (-1, self.worlds, *np.shape(values)[1:]))

    # ------------------------------------------------------------------ results

    def flagged(self) -> NDArray[np.bool_]:
        """Flags (copies,) of copies whose episode may have ended, or whose step has a reward."""
        if self.engine.stalled:
            return super().flagged()
        flags: NDArray[np.bool_] = self.task.eventful(self.state)
        if self._endings is not None:
            flags = (self._by_world(flags) & self._endings.running).any(axis=1)
        return flags

    def outcome(self, copies: Numbers) -> Outcome:
        """Returns ends and rewards of these copies."""
        self._some_ended = True
        if not self.engine.stalled:
            return super().outcome(copies)
        self.steps[copies] -= 1  # the step was not executed
        self._ends[self._balls_of(copies)] = End.STALLED
        outcome = super().outcome(copies)
        return Outcome(outcome.reward, outcome.terminated, outcome.truncated)

    def judge(self, copies: Numbers) -> Outcome:
        """Returns ends and rewards of these copies' balls."""
        state, balls = self._of(copies), self._balls_of(copies)
        ends = self.task.end(state)
        by_event = terminated(ends)
        self._ends[balls] = ends
        if self.halts:
            self._ends[self._balls_of(np.intersect1d(copies, [*self.halts]))] = End.HALTED
        cut = ~by_event & (ends != End.RUNNING)
        return Outcome(*map(self._by_world, (self.task.reward(state), by_event, cut)))

    def observe(self, copies: Index) -> Any:
        """Returns observations (n, M); computes them once after each step, on demand."""
        if self._gathered:
            parts = self._gathered
            if not isinstance(copies, slice):
                parts = [part[copies] for part in parts]
            return self._by_world(np.concatenate(parts, axis=1))
        balls = self._balls_of(copies)
        if self._unobserved:
            self._observations[balls] = self.observer.observe(self._of(copies), balls)
            self._unobserved = False
        return self._by_world(self._observations[balls])

    def info(self, copies: Index) -> Mapping[str, Any]:
        """Returns the task's entries, and the state of the episode, see `environment`."""
        info = self.task.info(self._of(copies))
        if self.worlds > 1:
            info = {name: np.asarray(value)[:: self.worlds] for name, value in info.items()}
        if not self._some_ended and isinstance(copies, slice):
            return info | self._running
        ends = self._ends[:: self.worlds][copies]
        info["stalled"] = ends == End.STALLED
        info["end"], info["end_text"] = ends, TEXTS[ends]
        return info

    def shown(self, copies: Index) -> tuple[Any, Mapping[str, Any]]:
        """Returns observations and infos; `worlds` flags the touched and returned balls."""
        if self._endings is None:
            info = self.info(copies)
            return self.observe(copies), info
        observed, info = super().shown(copies)
        task_info = self.task.info(self._of(copies))
        names = task_info.keys() & {"touched", "returned"}
        more = {name: self._by_world(task_info[name]) for name in names}
        return observed, {**info, "worlds": info["worlds"] | more}

    def render(self, copy: int) -> Any:
        """Draws a picture (480, 640, 3) of one copy."""
        world = self.world_of(copy)
        if self._pictures is None:
            self._pictures = Pictures(world, size=PICTURE, camera=self._camera)
        return self._pictures.draw(world.latest())

    def close(self) -> None:
        """Ends arms and worlds; may be called twice."""
        if self._pictures is not None:
            self._pictures.close()
        super().close()
