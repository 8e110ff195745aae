"""Fills the arrays of a rollout step by step."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

from o80.base.errors import InvalidArgument
from o80.learning.rollouts.rollout import Ends, Rollout, arrays_of

Numbers = NDArray[np.int64]


class EpisodeSums:
    """Reward and length so far of each copy's episode, kept across rollouts."""

    def __init__(self, copies: int) -> None:
        self.rewards, self.lengths = np.zeros(copies), np.zeros(copies, np.int64)

    def restart(self, copies: Numbers) -> None:
        """Begins new sums for copies whose episodes ended."""
        self.rewards[copies] = 0.0
        self.lengths[copies] = 0


class Recorder:
    """Records one rollout."""

    def __init__(
        self, environments: VectorEnv[Any, Any, Any], steps: int, infos: Sequence[str]
    ) -> None:
        count = environments.num_envs
        seen, acted = environments.single_observation_space, environments.single_action_space
        self._observations = np.empty((steps + 1, count, *(seen.shape or ())), seen.dtype)
        self._actions = np.empty((steps, count, *(acted.shape or ())), acted.dtype)
        self._log_probabilities = np.empty((steps, count))
        self._rewards = np.empty((steps, count))
        self._terminated = np.empty((steps, count), np.bool_)
        self._truncated = np.empty((steps, count), np.bool_)
        self._names = tuple(infos)
        # in the order of the fields of Ends; empty arrays for a rollout in which nothing ends
        none = np.zeros(0, np.int64)
        self._ends: list[tuple[NDArray[Any], ...]] = [
            (none, none, np.zeros(0), none, np.empty((0, *(seen.shape or ())), seen.dtype))
        ]
        self._infos: list[dict[str, NDArray[Any]]] = []

    def acted(
        self,
        step: int,
        observations: NDArray[Any],
        actions: NDArray[Any],
        log_probabilities: NDArray[Any],
    ) -> None:
        """Stores observations before a step, and the actions that the policy drew."""
        self._observations[step] = observations
        self._actions[step] = actions
        self._log_probabilities[step] = log_probabilities

    def stepped(
        self,
        step: int,
        result: tuple[Any, Any, Any, Any, Mapping[str, Any]],
        sums: EpisodeSums,
    ) -> None:
        """Stores the environments' results of a step, and adds them to the sums."""
        _, self._rewards[step], self._terminated[step], self._truncated[step], infos = result
        sums.rewards += self._rewards[step]
        sums.lengths += 1
        over = np.flatnonzero(self._terminated[step] | self._truncated[step])
        if not over.size:
            return
        last = np.stack([infos["final_obs"][copy] for copy in over.tolist()])
        self._ends.append(
            (np.full(over.size, step), over, sums.rewards[over], sums.lengths[over], last)
        )
        copies = len(self._rewards[step])
        self._infos.append(
            {name: entry(infos["final_info"], name, copies)[over] for name in self._names}
        )
        sums.restart(over)

    def rollout(self, observations: NDArray[Any]) -> Rollout:
        """Returns the rollout; `observations`: observations after its last step."""
        self._observations[-1] = observations
        steps, copies, rewards, lengths, last = (
            np.concatenate(column) for column in zip(*self._ends, strict=True)
        )
        infos = {
            name: np.concatenate([each[name] for each in self._infos])
            if self._infos
            else np.zeros(0)
            for name in self._names
        }
        rollout = Rollout(
            self._observations,
            self._actions,
            self._log_probabilities,
            self._rewards,
            self._terminated,
            self._truncated,
            Ends(steps, copies, rewards, lengths, last, infos),
        )
        for _, array in arrays_of(rollout):
            array.flags.writeable = False
        return rollout


def entry(infos: Mapping[str, Any], name: str, copies: int) -> NDArray[Any]:
    if name in ("halt", "is_success") and name not in infos:  # not every task or end has them
        return np.full(copies, None, object)
    if name in infos and isinstance(infos[name], np.ndarray):
        entry: NDArray[Any] = infos[name]
        return entry
    there = sorted(
        each
        for each, value in infos.items()
        if isinstance(value, np.ndarray) and not each.startswith("_")
    )
    raise InvalidArgument(
        f"infos: the environment's info has no array '{name}' at the end of an episode; it has "
        f"{', '.join(there) or 'none'}"
    )
