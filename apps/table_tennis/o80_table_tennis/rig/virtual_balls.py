"""The balls beside the one that is played: each meets the same arm and is paid for on its own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.base.arrays import FloatArray

from ..task.end import End, terminated
from ..task.observer import Observer, Observing
from ..task.outcome import returned
from ..task.state import State
from ..task.task import Task
from .ball_records import ball_records
from .rig import Rig


class VirtualBalls:
    """All extra balls, in the order of the twins that hold them."""

    def __init__(self, rig: Rig, task: Task, observing: Observing) -> None:
        self._twins, self._task = rig.twins, task
        self._count = rig.settings.extra_balls
        self._observer = Observer(task, observing, self._count)

    def begin(
        self,
        numbers: Sequence[int],
        played: State,
        generator: np.random.Generator,
    ) -> None:
        """A new episode with these balls; `played` is the state of the played one."""
        self._numbers = np.array(numbers, dtype=np.int64)
        self._ended = np.zeros(self._count, np.bool_)
        self._truncated = np.zeros(self._count, np.bool_)
        self._touched = np.zeros(self._count, np.bool_)
        self._returned = np.zeros(self._count, np.bool_)
        self._observations = self._observer.begin(
            self._state(played),
            [generator] * self._count,
            np.arange(self._count),
        )

    def observe(self, played: State) -> None:
        """Observes all extra balls, once after each step."""
        self._observations = self._observer.observe(self._state(played))

    def look(self, played: State, *, over: bool) -> dict[str, Any]:
        """`info["virtual"]` of the twins' newest rows; `played` is the state of the played ball.

        Each ball is paid for once: when its own episode ends, or when that of the played ball is
        `over`. From then on its entries are invalid, and `ended` is true; `truncated` is true where
        no event ended it, which a named task pays nothing for.
        """
        state = self._state(played)
        self._touched |= ~self._ended & state.record.touched
        self._returned |= ~self._ended & returned(state.record)
        return {
            "observations": self._observations.copy(),
            "rewards": self._judge(state, over=over),
            "touched": self._touched.copy(),
            "returned": self._returned.copy(),
            "ended": self._ended.copy(),
            "truncated": self._truncated.copy(),
            "balls": self._numbers.copy(),
        }

    def _state(self, played: State) -> State:
        """The states of all extra balls: the arm is that of the played one."""
        records = np.concatenate([twin.all_records[twin.extra] for twin in self._twins])
        return State(
            self._shared(np.asarray(played.steps)),
            self._shared(played.motion),
            self._shared(played.pressures),
            self._shared(played.asked),
            self._shared(played.racket),
            np.concatenate([twin.all_balls[0, twin.extra] for twin in self._twins]),
            ball_records(records),
            self._shared(played.goal),
        )

    def _shared(self, array: NDArray[Any]) -> NDArray[Any]:
        """Array (N, ...) of every extra ball, from that of the played one (1, ...)."""
        return np.broadcast_to(array, (self._count, *array.shape[1:]))

    def _judge(self, state: State, *, over: bool) -> FloatArray:
        """The rewards (N,) that are paid now."""
        rewards = np.zeros(self._count)
        judged = ~self._ended & (self._task.eventful(state) | over)
        if judged.any():
            some = state.at(judged)
            rewards[judged] = self._task.reward(some)
            ends = self._task.end(some)
            self._ended[judged] = over | (ends != End.RUNNING)
            self._truncated[judged] = self._ended[judged] & ~terminated(ends)
        return rewards
