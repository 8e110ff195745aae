"""Collectors of a training: of several copies, repeatable, or of whole episodes of one copy."""

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import VectorActionWrapper, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from o80.learning.rollouts import Collector, Make, Policy, Rollout
from o80.learning.rollouts.collector import environment_seeds, policy_generator
from o80.learning.rollouts.recorder import EpisodeSums, Recorder
from o80.learning.training.tasks import spread


class Scaled(VectorActionWrapper[Any, Any, Any, Any]):
    """Spreads actions in [-1, 1] over the limits of the environments' action space."""

    def __init__(self, environments: VectorEnv[Any, Any, Any]) -> None:
        super().__init__(environments)
        shape = environments.single_action_space.shape or ()
        self.single_action_space = Box(-1.0, 1.0, shape, np.float32)
        self.action_space = batch_space(self.single_action_space, environments.num_envs)

    def actions(self, actions: Any) -> Any:
        """(N, A) in [-1, 1] => (N, A) in the action space of the environments."""
        return spread(actions, self.env.single_action_space)


class RepeatableCollector(Collector):
    """Stores the actions since its environments began, so that another one can repeat them."""

    def __init__(self, make: Make, **options: Any) -> None:
        self.seconds = 0.0
        """Time spent in collecting [s]."""
        self.resetting = 0.0
        """Part of it that was spent in resets, as far as known [s]."""
        super().__init__(make, **options)

    def _begin(self) -> None:
        super()._begin()
        self.keep_nothing()

    def keep_nothing(self) -> None:
        """Clears the stored actions: the environments have begun in this iteration."""
        self.begun = self.iteration
        """Iteration in which the environments began."""
        self.played: list[NDArray[Any]] = []
        """Actions (T, N, A) of each rollout since then."""

    def collect(self, policy: Policy, *, steps: int) -> Rollout:
        """Collects a rollout and stores its actions."""
        since = time.monotonic()
        rollout = super().collect(policy, steps=steps)
        self.seconds += time.monotonic() - since
        self.played.append(rollout.actions)
        return rollout

    def repeat(self, played: Sequence[NDArray[Any]]) -> None:
        """Repeats the rollouts of another collector that began in the same iteration."""
        for actions in played:
            self.collect(_Played(actions), steps=len(actions))
        self.seconds = 0.0


class _Played:
    """Repeats actions (T, N, A)."""

    def __init__(self, actions: NDArray[Any]) -> None:
        self._rows = iter(actions)

    def sample(self, observations: NDArray[Any], _: Any) -> tuple[NDArray[Any], NDArray[Any]]:
        return next(self._rows), np.zeros(len(observations))


class EpisodeCollector(RepeatableCollector):
    """Collects whole episodes of one copy: a rollout begins with a reset and ends with an episode.

    Everything between two rollouts thus happens between two episodes. Needs an environment in
    autoreset mode Disabled.
    """

    def _begin(self) -> None:
        self._environments = self._make()
        self.keep_nothing()

    def collect(self, policy: Policy, *, steps: int) -> Rollout:
        """Collects whole episodes of at least `steps` steps together."""
        rollout = super().collect(policy, steps=steps)
        self.keep_nothing()
        return rollout

    def _collected(self, policy: Policy, steps: int) -> Rollout:
        generator = policy_generator(self.seed, self.number, self.iteration)
        observations = self._reset(environment_seeds(self.seed, self.number, self.iteration, 1))
        taken: list[tuple[Any, ...]] = []
        over = False
        while len(taken) < steps or not over:
            before = self._reset(None) if over else observations
            actions, log_probabilities = policy.sample(before, generator)
            result = self._environments.step(actions)
            observations, _, terminated, truncated, info = result
            over = bool(terminated[0] or truncated[0])
            finals = {"final_obs": observations, "final_info": info}
            taken.append((before, actions, log_probabilities, (*result[:4], finals)))
        recorder = Recorder(self._environments, len(taken), self._infos)
        sums = EpisodeSums(1)
        for step, (*drawn, result) in enumerate(taken):
            recorder.acted(step, *drawn)
            recorder.stepped(step, result, sums)
        return recorder.rollout(observations)

    def _reset(self, seeds: Any) -> Any:
        since = time.monotonic()
        observations, _ = self._environments.reset(seed=seeds)
        self.resetting += time.monotonic() - since
        return observations
