"""Rewards and ends per world, where a robot has several worlds."""

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from o80.base.errors import InvalidArgument
from o80.learning.task import Index, Outcome

Mask = NDArray[np.bool_]


class Endings:
    """Rewards and ends of the worlds of n robots in the last step: arrays (copies, worlds)."""

    def __init__(self, copies: int, worlds: int, end: Literal["first", "all"]) -> None:
        self._end, shape = end, (copies, worlds)
        self.running: Mask = np.ones(shape, np.bool_)
        """Worlds whose episode has not ended."""
        self._has_terminated: Mask = np.zeros(copies, np.bool_)  # by copy, of its first world
        self.arrays: dict[str, NDArray[Any]] = {
            "reward": np.zeros(shape),
            "terminated": np.zeros(shape, np.bool_),
            "truncated": np.zeros(shape, np.bool_),
            "running": np.ones(shape, np.bool_),
        }

    def begin(self, copies: NDArray[np.intp]) -> None:
        """Begins episodes of these copies."""
        self.running[copies], self._has_terminated[copies] = True, False
        self.step(copies)

    def step(self, copies: Index) -> None:
        """Begins a step of these copies."""
        for array in self.arrays.values():
            array[copies] = 0
        self.arrays["running"][copies] = self.running[copies]

    def take(self, copies: NDArray[np.intp], outcome: Outcome, halted: Mask, late: Mask) -> Outcome:
        """Returns the outcome of these copies, from what `judge` returned for all their worlds.

        halted, late: (n,) copies that ended so. Raises InvalidArgument for a wrong shape or reward.
        """
        running = self.running[copies]
        reward = np.where(running, _by_world(outcome.reward, running, "reward"), 0.0)
        if not np.isfinite(reward).all():
            copy, world = np.argwhere(~np.isfinite(reward))[0]
            raise InvalidArgument(
                f"judge gave world {world} of copy {copies[copy]} the reward "
                f"{reward[copy, world]}: it must be finite"
            )
        terminated: Mask = _by_world(outcome.terminated, running, "terminated") | halted[:, None]
        truncated: Mask = _by_world(outcome.truncated, running, "truncated") | late[:, None]
        terminated, truncated = terminated & running, truncated & running
        running = running & ~(terminated | truncated)
        deciding = running[:, :1] if self._end == "first" else running
        over: Mask = ~np.logical_or.reduce(deciding, axis=1)
        truncated |= running & over[:, None]
        self.running[copies] = running & ~over[:, None]
        self._has_terminated[copies] |= terminated[:, 0]
        ends = {"reward": reward, "terminated": terminated, "truncated": truncated}
        for name, values in ends.items():
            self.arrays[name][copies] = values
        if self._end == "all":
            ended = over & self._has_terminated[copies]
            return Outcome(reward[:, 0], ended, over & ~ended, outcome.info)
        return Outcome(reward[:, 0], terminated[:, 0], truncated[:, 0], outcome.info)


def _by_world(values: Any, like: Mask, what: str) -> NDArray[Any]:
    given = np.asarray(values, np.float64 if what == "reward" else np.bool_)
    try:
        return np.broadcast_to(given[:, np.newaxis] if given.ndim == 1 else given, like.shape)
    except ValueError:
        raise InvalidArgument(
            f"judge must return {what} of the shape (copies, worlds) = {like.shape}, got "
            f"{given.shape}"
        ) from None
