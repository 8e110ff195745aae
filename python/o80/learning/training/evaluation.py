"""Evaluates policies on a task, with the same episodes for each policy."""

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from numpy.typing import NDArray

from o80.base.argument_checks import whole
from o80.base.arrays import FloatArray
from o80.base.errors import InvalidArgument
from o80.learning.rollouts.recorder import entry
from o80.learning.training.curve import success_share
from o80.learning.training.policy import LearnedPolicy
from o80.learning.training.tasks import NamedTask

NORMAL_95 = 1.959963984540054
"""Standard deviations within which 95 % of a normal distribution lie."""

SEED = 7_000_001
"""Seed of the first episode, far from the seeds of trainings."""
BASELINES = ("nothing", "random")
"""Policies without training: the action 0 (or the nearest one), and uniformly drawn actions."""


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Episodes of one policy; episode i of each policy began with the same seed."""

    name: str
    successes: FloatArray
    """(E,) 1, 0, or NaN if the info does not report success."""
    rewards: FloatArray
    """(E,) sums of rewards over the episodes."""
    lengths: FloatArray
    """(E,) steps of the episodes."""

    @property
    def success(self) -> float:
        """Share of successes; NaN if the task does not report success."""
        return success_share(self.successes)

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's interval of the share of successes, 95 %."""
        return wilson(int(np.nansum(self.successes)), len(self.successes))

    def gain(self, other: "Evaluation") -> tuple[float, float]:
        """Returns the mean reward gain over the other policy in the same episodes, and half of its
        interval (95 %).
        """
        more = self.rewards - other.rewards
        spread = float(more.std(ddof=1)) if len(more) > 1 else np.nan
        return float(more.mean()), NORMAL_95 * spread / np.sqrt(len(more))

    def only_here(self, other: "Evaluation") -> int:
        """Counts episodes that were a success here, but not with the other policy."""
        return int(((self.successes == 1) & (other.successes != 1)).sum())


def evaluate(
    policies: Sequence[str | os.PathLike[str]],
    *,
    task: NamedTask | None = None,
    episodes: int = 200,
    seed: int = SEED,
    copies: int | None = None,
) -> list[Evaluation]:
    """Evaluates each policy in the same episodes of a task, without exploration.

    policies: "nothing", "random", or files or folders of learned policies.
    task: by default the task of the first learned policy.
    seed: seed of the first episode; each next episode has the next seed.
    copies: copies to step together; by default those of the training, at most one per episode.

    Raises InvalidArgument for an unknown policy or task.
    """
    episodes, seed = whole(episodes, "episodes", 1), whole(seed, "seed", 0)
    names = [str(each) for each in policies]
    learned = {name: LearnedPolicy.load(name) for name in names if name not in BASELINES}
    first = next(iter(learned.values()), None)
    task = first.task if task is None and first else task
    if task is None:
        raise InvalidArgument("`nothing` and `random` play any task: give task")
    if copies is None:
        copies = int(first.training.get("copies", 1)) if first else 1
    count = min(whole(copies, "copies", 1), episodes)
    played = []
    for name in names:
        environments = task.make_vec(count, AutoresetMode.DISABLED)
        try:
            policy = learned.get(name, name)
            played.append(_played(name, policy, environments, task.success, episodes, seed))
        finally:
            environments.close()
    return played


def _played(
    name: str,
    policy: LearnedPolicy | str,
    environments: VectorEnv[Any, Any, Any],
    success: str,
    episodes: int,
    seed: int,
) -> Evaluation:
    space: Any = environments.single_action_space
    if isinstance(policy, LearnedPolicy):
        inputs, outputs = len(policy.network.mean), len(policy.network.log_std)
        (seen,) = environments.single_observation_space.shape or ()
        if (inputs, outputs) != (seen, *space.shape):
            raise InvalidArgument(
                f"policy '{name}' has {inputs} observed numbers and {outputs} actions, the task "
                f"has {seen} and {space.shape[0]}"
            )
    copies = environments.num_envs
    current = np.arange(copies)  # episode of each copy; episodes from `episodes` on do not count
    observations, _ = environments.reset(seed=seed)  # copy i: seed + i
    generators = [np.random.default_rng((seed, number)) for number in range(copies)]
    rewards, lengths, told = np.zeros(copies), np.zeros(copies), np.full((episodes, 3), np.nan)
    following, left = copies, episodes
    while left:
        actions = _actions(policy, observations, space, generators)
        observations, paid, terminated, truncated, info = environments.step(actions)
        rewards += paid
        lengths += 1
        over = terminated | truncated
        if not over.any():
            continue
        successes = entry(info, success, copies).astype(np.float64)  # NaN for None
        seeds: list[int | None] = [None] * copies
        for copy in np.flatnonzero(over).tolist():
            if current[copy] < episodes:
                told[current[copy]] = successes[copy], rewards[copy], lengths[copy]
                left -= 1
            seeds[copy] = seed + following
            generators[copy] = np.random.default_rng((seed, following))
            current[copy], rewards[copy], lengths[copy] = following, 0.0, 0.0
            following += 1
        if left:
            observations, _ = environments.reset(seed=seeds, options={"reset_mask": over})  # type: ignore[arg-type]
    return Evaluation(name, *told.T)


def _actions(
    policy: LearnedPolicy | str,
    observations: NDArray[Any],
    space: Any,
    generators: Sequence[np.random.Generator],
) -> NDArray[Any]:
    """Returns the actions (N, A) of a policy."""
    if isinstance(policy, LearnedPolicy):
        return policy.act(observations)
    if policy == "nothing":
        still = np.clip(np.zeros(space.shape), space.low, space.high)
        return np.tile(still, (len(observations), 1)).astype(space.dtype)
    drawn = [generator.uniform(space.low, space.high) for generator in generators]
    return np.array(drawn, space.dtype)


def wilson(successes: int, count: int) -> tuple[float, float]:
    """Returns Wilson's interval of a share, which holds the true share in 95 % of all cases.

    It is (0, 1) for no episode. Unlike a standard deviation it stays within 0 and 1, and has a
    width if all or none succeeded.
    """
    if not 0 <= successes <= count:
        raise InvalidArgument(f"successes must lie between 0 and {count}, got {successes}")
    if count == 0:
        return 0.0, 1.0
    share, z2 = successes / count, NORMAL_95 * NORMAL_95
    middle = (share + z2 / (2 * count)) / (1 + z2 / count)
    spread = math.sqrt(share * (1 - share) / count + z2 / (4 * count * count))
    half = NORMAL_95 * spread / (1 + z2 / count)
    # rounding must not leave the share, or 0 and 1, outside
    return max(0.0, min(middle - half, share)), min(1.0, max(middle + half, share))
