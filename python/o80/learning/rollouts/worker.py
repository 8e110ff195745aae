"""A worker: a vector environment that plays policies, in whatever process it lives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Any, NamedTuple, Protocol, Self

import numpy as np
from gymnasium import Space
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from numpy.typing import NDArray

from o80.errors import InvalidArgument
from o80.learning.rollouts.recorder import EpisodeSums, Recorder
from o80.learning.rollouts.rollout import Rollout

Make = Callable[[], "VectorEnv[Any, Any, Any]"]
"""Makes the vector environment of a worker, in autoreset mode SameStep."""


class Spaces(NamedTuple):
    """What the environments of a worker are like."""

    copies: int
    observation: Space[Any]
    """Of one copy."""
    action: Space[Any]


class Policy(Protocol):
    """What a worker plays: weights, and how to act with them. Ray pickles it."""

    def sample(
        self, observations: NDArray[Any], generator: np.random.Generator
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        """Actions (N, ...) after observations (N, ...), and their log-probabilities (N,).

        All random numbers must come from `generator`.
        """
        ...


class Worker:
    """Collects the rollouts of one vector environment.

    All random numbers follow from (seed, worker, iteration): those of the environments from the
    iteration in which the worker begins, those of the policy from the iteration of the rollout.
    """

    def __init__(
        self,
        make: Make,
        *,
        worker: int = 0,
        seed: int = 0,
        iteration: int = 0,
        infos: Sequence[str] = (),
    ) -> None:
        """worker: its number. iteration: in which it begins, with a reset of all copies.

        infos: entries of Gymnasium's info that `Ends` keeps of each episode.
        """
        self._worker, self._seed, self._begun = worker, seed, iteration
        self._infos = tuple(infos)
        self._environments = make()
        try:
            _refuse_unless_collectable(self._environments)
            count = self._environments.num_envs
            self._sums = EpisodeSums(count)
            # one for each copy, which VectorEnv's own annotation leaves out
            seeds: Any = environment_seeds(seed, worker, iteration, count)
            self._observations, _ = self._environments.reset(seed=seeds)
        except BaseException:
            self.close()
            raise

    @property
    def spaces(self) -> Spaces:
        """Of the environments."""
        made = self._environments
        return Spaces(made.num_envs, made.single_observation_space, made.single_action_space)

    def collect(self, policy: Policy, *, steps: int, iteration: int) -> Rollout:
        """The rollout of `iteration`: so many steps of all copies, from where they are."""
        environments = self._environments
        generator = policy_generator(self._seed, self._worker, iteration)
        recorder = Recorder(environments, steps, self._infos)
        for step in range(steps):
            actions, log_probabilities = policy.sample(self._observations, generator)
            recorder.acted(step, self._observations, actions, log_probabilities)
            result = environments.step(_inside(environments.single_action_space, actions))
            recorder.stepped(step, result, self._sums)
            self._observations = result[0]
        return recorder.rollout(
            self._observations, worker=self._worker, iteration=iteration, begun=self._begun
        )

    def close(self) -> None:
        """Closes the environments."""
        self._environments.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def environment_seeds(seed: int, worker: int, iteration: int, copies: int) -> list[int]:
    """Of the copies of a worker that begins in `iteration`."""
    sequence = np.random.SeedSequence((seed, worker, iteration, 0))
    words: list[int] = sequence.generate_state(copies, np.uint64).tolist()
    return [word >> 1 for word in words]


def policy_generator(seed: int, worker: int, iteration: int) -> np.random.Generator:
    """That a policy draws from in the rollout of `iteration`."""
    return np.random.default_rng((seed, worker, iteration, 1))


def _inside(space: Any, actions: NDArray[Any]) -> NDArray[Any]:
    if isinstance(space, Box):
        actions = np.clip(actions, space.low, space.high).astype(space.dtype, copy=False)
    return actions


def _refuse_unless_collectable(environments: VectorEnv[Any, Any, Any]) -> None:
    """Raises InvalidArgument."""
    mode = environments.metadata.get("autoreset_mode")
    if mode != AutoresetMode.SAME_STEP:
        raise InvalidArgument(
            "rollouts need environments in autoreset mode SameStep, these are in "
            f"{getattr(mode, 'value', mode)}: make them with autoreset_mode='SameStep' "
            "(SyncVectorEnv and AsyncVectorEnv: AutoresetMode.SAME_STEP)"
        )
    for name in ("single_observation_space", "single_action_space"):
        space = getattr(environments, name)
        if space.shape is None or space.dtype is None:
            raise InvalidArgument(f"rollouts need a {name} of arrays, such as a Box, got {space}")
