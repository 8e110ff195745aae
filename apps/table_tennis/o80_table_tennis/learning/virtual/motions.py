"""Motions of the arm that many balls meet at once: the transitions of every ball.

The arm plays the first ball. It cannot tell the others, which meet the same motion in the same
twin. A motion lasts until the episode of every ball has ended. Once the episode of the played ball
has ended, its pressures stay as they are: nobody is asked any more, but other balls still fly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from o80.base.arrays import Float32Array, FloatArray
from o80.base.lifecycle import Closeable
from o80.learning import EVERY

from ...balls.sources import balls_from
from ...episode_draw import drawn_episode
from ...rig.ball_records import ball_records
from ...rig.rig import Rig
from ...settings import Pacing, RigSettings, TaskSettings
from ...task.actions import changed_pressures
from ...task.end import End, terminated
from ...task.observer import Observer
from ...task.outcome import returned
from ...task.state import State
from ...world.arm import MUSCLES

Flags = NDArray[np.bool_]
Whole = NDArray[np.int64]
Policy = Callable[[Float32Array], Float32Array]
"""Observation (M,) of the played ball => action (8,)."""

STILL = np.zeros(MUSCLES, np.float32)
NEVER = 2**31
"""A step that no episode reaches."""


@dataclass(frozen=True)
class Motion:
    """T steps of the arm and N balls, the played one first."""

    observations: Float32Array
    """(T + 1, N, M): the one before each step, and the last one."""
    actions: Float32Array
    """(T, 8), the same for every ball."""
    rewards: Float32Array
    """(T, N), 0 after the end of a ball's episode."""
    lengths: Whole
    """(N,) steps of each ball's episode."""
    terminated: Flags
    """(N,) whether an event has ended it; otherwise it was cut off."""
    touched: Flags
    """(N,)"""
    returned: Flags
    """(N,)"""
    balls: Whole
    """(N,) their numbers."""

    @property
    def paid(self) -> Float32Array:
        """(N,) sum of the rewards of each ball's episode."""
        total: Float32Array = self.rewards.sum(axis=0)
        return total


class Motions(Closeable):
    """One arm and one twin with N balls, inline. Close it, or leave its `with` block."""

    def __init__(self, balls: int, *, rig: RigSettings, task: TaskSettings) -> None:
        """`task.fly_out`: the episode of a ball ends with its touch, and is paid for what came of
        it, as in the environment; but a second touch of the racket may happen here.
        """
        if rig.pacing is not Pacing.INLINE or rig.twins != 1:
            raise ValueError("motions need RigSettings(pacing=Pacing.INLINE, twins=1)")
        self.settings, self._task = task, task.made()
        if not self._task.plays_ball:
            raise ValueError("motions with virtual balls need a task that plays a ball")
        self._count = balls
        self._source = balls_from(task.balls, task.ball_seed, rig.period, task.ball_count)
        self._observer = Observer(self._task, task.observing(rig.step), balls)
        self._pressures = np.zeros((1, MUSCLES))
        self._rig = Rig(replace(task.start_of(rig), extra_balls=balls - 1), delay=task.delay)

    def close(self) -> None:
        """Ends arm and twin; may be called twice."""
        self._rig.close()

    def play(self, policy: Policy, generator: np.random.Generator) -> Motion:
        """One motion, with balls drawn from `generator`."""
        numbers = self._begin(generator)
        episodes = _Episodes(self._count)
        each = [generator] * self._count
        first = self._observer.begin(
            self._look(0), self._shared(self._commanded), each, np.arange(self._count)
        )
        observations, actions = [first], list[Float32Array]()
        while episodes.running.any():
            action = policy(observations[-1][0]) if self._asks(episodes) else STILL
            self._step(action)
            state = self._look(len(actions) + 1)
            actions.append(action)
            observations.append(self._observer.observe(state, self._shared(self._commanded)))
            self._judge(state, episodes)
        rewards = np.array(episodes.rewards, np.float32)
        lengths = episodes.lengths
        if self.settings.fly_out:
            lengths = _ended_at_touch(rewards, lengths, episodes.touched_at)
        return Motion(
            np.array(observations),
            np.array(actions, np.float32),
            rewards,
            lengths,
            episodes.terminated,
            episodes.touched_at < episodes.lengths,
            episodes.returned,
            np.array(numbers, np.int64),
        )

    def _begin(self, generator: np.random.Generator) -> list[int]:
        """As the environment begins an episode; returns the numbers of the balls."""
        draw = drawn_episode(self._task, self._source, generator, extra=self._count - 1, options={})
        rig = self._rig
        rig.reset(
            EVERY,
            arm_seeds=[draw.arm_seed],
            twin_seeds=[draw.twin_seed],
            flights=[draw.balls.flights],
        )
        rig.begin()
        self._commanded = rig.arm.commanded()
        self._goals = np.broadcast_to(draw.goal, (self._count, *draw.goal.shape))
        return draw.balls.numbers

    def _asks(self, episodes: _Episodes) -> bool:
        """Whether the played ball is still in play, so that the policy is asked."""
        untouched = episodes.touched_at[0] == NEVER
        return bool(episodes.running[0] and (untouched or not self.settings.fly_out))

    def _step(self, action: Float32Array) -> None:
        """As the environment steps."""
        for _ in range(self.settings.repeat):
            factor = self.settings.factor
            self._commanded = changed_pressures(self._commanded, action[np.newaxis], factor=factor)
            self._rig.step(self._commanded)

    def _look(self, steps: int) -> State:
        """The states of all balls."""
        arm, twin = self._rig.arm, self._rig.twin
        arm.read_pressures(self._pressures)
        return State(
            np.full(self._count, steps),
            self._shared(arm.last_motion),
            self._shared(self._pressures),
            self._shared(arm.last_racket),
            twin.all_balls[0],
            ball_records(twin.all_records),
            self._goals,
        )

    def _shared(self, array: FloatArray) -> FloatArray:
        """Array (N, ...) of every ball, from that of the arm (1, ...)."""
        return np.broadcast_to(array, (self._count, *array.shape[1:]))

    def _judge(self, state: State, episodes: _Episodes) -> None:
        """Judges the step that led to this state, for the balls in play."""
        playing = episodes.running.copy()
        touched = playing & state.record.touched
        judged = playing & self._task.eventful(state)
        rewards = np.zeros(self._count)
        ends = np.full(self._count, int(End.RUNNING))
        if judged.any():
            some = state.at(judged)
            rewards[judged] = self._task.reward(some)
            ends[judged] = self._task.end(some)
        episodes.add(rewards, touched=touched, ends=ends, returned=returned(state.record))


class _Episodes:
    """The episodes of N balls while they run."""

    def __init__(self, count: int) -> None:
        self.running = np.ones(count, np.bool_)
        self.rewards: list[FloatArray] = []
        self.lengths = np.zeros(count, np.int64)
        self.touched_at = np.full(count, NEVER)
        """The step, from 0, in which the ball was touched first."""
        self.terminated = np.zeros(count, np.bool_)
        self.returned = np.zeros(count, np.bool_)

    def add(self, rewards: FloatArray, *, touched: Flags, ends: Whole, returned: Flags) -> None:
        """A step of all; `ends` are RUNNING for those that go on, or have ended before."""
        step = len(self.rewards)
        self.rewards.append(rewards)
        self.touched_at[touched] = np.minimum(self.touched_at[touched], step)
        ended = self.running & (ends != End.RUNNING)
        self.lengths[ended] = step + 1
        self.terminated[ended] = terminated(ends[ended])
        self.returned[ended] = returned[ended]
        self.running &= ~ended


def _ended_at_touch(rewards: Float32Array, lengths: Whole, touched_at: Whole) -> Whole:
    """Moves what is paid after a touch to the step of the touch; returns the lengths until then."""
    shorter = np.minimum(lengths, touched_at + 1)
    for ball in np.flatnonzero(shorter < lengths):
        last = shorter[ball] - 1
        rewards[last, ball] = rewards[last:, ball].sum()
        rewards[last + 1 :, ball] = 0.0
    return shorter
