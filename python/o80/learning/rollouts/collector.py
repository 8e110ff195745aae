"""Collects rollouts: runs policies in a vector environment."""

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
from gymnasium import Space
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from numpy.typing import NDArray

from o80.base.argument_checks import whole
from o80.base.errors import Closed, InvalidArgument
from o80.base.lifecycle import Closeable
from o80.learning.rollouts.recorder import EpisodeSums, Recorder
from o80.learning.rollouts.rollout import Rollout

Make = Callable[[], "VectorEnv[Any, Any, Any]"]
"""Makes a vector environment in autoreset mode SameStep."""


class Policy(Protocol):
    """A policy that can be run: it draws actions."""

    def sample(
        self, observations: NDArray[Any], generator: np.random.Generator
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        """Draws actions (N, ...) for observations (N, ...); returns log-probabilities (N,) too.

        All random numbers must come from `generator`.
        """
        ...


class Collector(Closeable):
    """Collects the rollouts of one vector environment.

    All random numbers follow from (seed, number, iteration): for the environments from the
    iteration in which they began, for the policy from the iteration of the rollout. So equal seeds
    and policies give equal rollouts, bit for bit, in any process.

    After an exception in `collect` the next call makes new environments and repeats the iteration.
    """

    def __init__(
        self,
        make: Make,
        *,
        seed: int = 0,
        number: int = 0,
        iteration: int = 0,
        infos: Sequence[str] = (),
    ) -> None:
        """make: makes the vector environment, in autoreset mode SameStep.

        seed: seed of all random numbers. number: distinguishes collectors with the same seed.
        iteration: the first one; a resumed training gives the iteration that it has reached.
        infos: entries of Gymnasium's info that `Rollout.ends` keeps for each episode.
        """
        self.seed = whole(seed, "seed", 0)
        self.number = whole(number, "number", 0)
        self.iteration = whole(iteration, "iteration", 0)  #: iteration of the next `collect`
        self._make, self._infos = make, tuple(infos)
        self._interrupted = False  # a rollout was begun and not finished
        self._closed = False
        self._begin()

    def collect(self, policy: Policy, *, steps: int) -> Rollout:
        """Runs `steps` steps of all copies, from their current states; ends the iteration."""
        steps = whole(steps, "steps", 1)
        self._refuse_if_closed()
        if self._interrupted:
            self.restart(self.iteration)
        self._interrupted = True
        rollout = self._collected(policy, steps)
        self._interrupted = False
        self.iteration += 1
        return rollout

    def restart(self, iteration: int) -> None:
        """Restarts with new environments, in `iteration`."""
        self._refuse_if_closed()
        self.iteration = whole(iteration, "iteration", 0)
        self._interrupted = True
        self._environments.close()
        self._begin()
        self._interrupted = False

    @property
    def copies(self) -> int:
        """Number of copies that the environment steps together."""
        return self._environments.num_envs

    @property
    def observation_space(self) -> Space[Any]:
        """Observation space of one copy."""
        return self._environments.single_observation_space

    @property
    def action_space(self) -> Space[Any]:
        """Action space of one copy."""
        return self._environments.single_action_space

    def close(self) -> None:
        """Closes the environments; may be called twice."""
        if not self._closed:
            self._closed = True
            self._environments.close()

    def _refuse_if_closed(self) -> None:
        if self._closed:
            raise Closed("this collector was closed: make a new one")

    def _begin(self) -> None:
        """Makes the environments and resets them."""
        self._environments = self._make()
        try:
            _refuse_unless_collectable(self._environments)
            count = self._environments.num_envs
            self._sums = EpisodeSums(count)
            # one for each copy, which VectorEnv's own annotation leaves out
            seeds: Any = environment_seeds(self.seed, self.number, self.iteration, count)
            self._observations, _ = self._environments.reset(seed=seeds)
        except BaseException:
            self._environments.close()
            raise

    def _collected(self, policy: Policy, steps: int) -> Rollout:
        environments, space = self._environments, self._environments.single_action_space
        generator = policy_generator(self.seed, self.number, self.iteration)
        recorder = Recorder(environments, steps, self._infos)
        for step in range(steps):
            actions, log_probabilities = policy.sample(self._observations, generator)
            recorder.acted(step, self._observations, actions, log_probabilities)
            if isinstance(space, Box):
                actions = np.clip(actions, space.low, space.high).astype(space.dtype, copy=False)
            result = environments.step(actions)
            recorder.stepped(step, result, self._sums)
            self._observations = result[0]
        return recorder.rollout(self._observations)


def environment_seeds(seed: int, number: int, iteration: int, copies: int) -> list[int]:
    """Returns the seeds of the copies of a collector that begins in `iteration`."""
    sequence = np.random.SeedSequence((seed, number, iteration, 0))
    words: list[int] = sequence.generate_state(copies, np.uint64).tolist()
    return [word >> 1 for word in words]


def policy_generator(seed: int, number: int, iteration: int) -> np.random.Generator:
    """Makes the random generator of the policy in the rollout of `iteration`."""
    return np.random.default_rng((seed, number, iteration, 1))


def _refuse_unless_collectable(environments: VectorEnv[Any, Any, Any]) -> None:
    """Raises InvalidArgument for another autoreset mode, or spaces other than arrays."""
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
