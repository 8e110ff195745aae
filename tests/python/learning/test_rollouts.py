"""Rollouts of a collector (o80.learning.rollouts)."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations
from typing import Any, ClassVar

import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from learning_tasks import COPIES, INFOS, Goal, Reach, reaching
from vector_equality import assert_same

import o80
from o80.learning import Environment, Outcome, VectorEnvironment
from o80.learning.rollouts import Collector, GaussianPolicy, Make, Rollout
from o80.learning.rollouts.collector import environment_seeds, policy_generator
from o80.learning.rollouts.rollout import arrays_of

STEPS = 11


def policies(count: int) -> Sequence[GaussianPolicy]:
    """Creates policies with a small network and random numbers."""
    first = GaussianPolicy.new(6, 4, hidden=(32, 16), log_std=-0.7, seed=4)
    random = np.random.default_rng(8)
    return [
        replace(
            first,
            mean=random.normal(0, 0.1, 6).astype(np.float32),
            scale=random.uniform(0.5, 2, 6).astype(np.float32),
            weights=tuple(
                random.normal(0, 0.3, weight.shape).astype(np.float32) for weight in first.weights
            ),
        )
        for _ in range(count)
    ]


def collector_of(make: Make = reaching, **options: Any) -> Collector:
    return Collector(make, number=1, seed=5, infos=INFOS, **options)


def collected(count: int) -> list[Rollout]:
    with collector_of() as collector:
        return [collector.collect(policy, steps=STEPS) for policy in policies(count)]


def test_a_rollout_is_what_its_actions_make_of_the_environments() -> None:
    rollouts = collected(3)
    singles: Any = SyncVectorEnv(
        [lambda: Environment(Reach())] * COPIES, autoreset_mode=AutoresetMode.SAME_STEP
    )
    seen, _ = singles.reset(seed=environment_seeds(5, 1, 0, COPIES))
    paid, lengths, ends = np.zeros(COPIES), np.zeros(COPIES, int), 0
    for rollout in rollouts:
        expected = []
        for step in range(STEPS):
            assert rollout.observations[step].tobytes() == seen.tobytes()
            action = np.clip(rollout.actions[step], -1, 1)
            seen, rewards, terminated, truncated, infos = singles.step(action)
            assert rollout.rewards[step].tobytes() == rewards.tobytes()
            assert rollout.terminated[step].tolist() == terminated.tolist()
            assert rollout.truncated[step].tolist() == truncated.tolist()
            paid += rewards
            lengths += 1
            for copy in np.flatnonzero(terminated | truncated):
                at_end = (infos["final_info"][name][copy] for name in INFOS)
                last = infos["final_obs"][copy].tobytes()
                expected.append((step, copy, paid[copy], lengths[copy], *at_end, last))
                paid[copy], lengths[copy] = 0, 0
        assert rollout.observations[STEPS].tobytes() == seen.tobytes()
        assert list(rows_of(rollout)) == expected
        ends += len(expected)
    singles.close()
    assert ends > 3 * COPIES


def rows_of(rollout: Rollout) -> Sequence[Any]:
    ends = rollout.ends
    last = [each.tobytes() for each in ends.observations]
    columns = (ends.steps, ends.copies, ends.rewards, ends.lengths)
    return list(zip(*columns, ends.infos["apart"], ends.infos["why"], last, strict=True))


def test_actions_are_drawn_by_the_policy_from_the_generator_of_the_iteration() -> None:
    rollouts = collected(2)
    for iteration, (policy, rollout) in enumerate(zip(policies(2), rollouts, strict=True)):
        generator = policy_generator(5, 1, iteration)
        for step in range(STEPS):
            actions, logarithms = policy.sample(rollout.observations[step], generator)
            assert actions.tobytes() == rollout.actions[step].tobytes()
            assert logarithms.tobytes() == rollout.log_probabilities[step].tobytes()


def test_log_probabilities_are_those_of_the_normal_distributions() -> None:
    policy = policies(1)[0]
    seen = np.random.default_rng(1).normal(0, 1, (7, 6)).astype(np.float32)
    actions, logarithms = policy.sample(seen, np.random.default_rng(2))
    deviation = np.exp(policy.log_std.astype(float))
    away = (actions - policy.means(seen)) / deviation
    densities = np.exp(-0.5 * away**2) / (deviation * math.sqrt(2 * math.pi))
    assert logarithms == pytest.approx(np.log(densities.prod(axis=1)), abs=1e-4)


def test_the_means_are_those_of_the_network() -> None:
    policy = policies(1)[0]
    seen = np.random.default_rng(1).normal(0, 30, (7, 6))
    layer = np.clip((seen - policy.mean) * policy.scale, -10, 10)
    assert np.abs(layer).max() == 10
    for weight, bias in zip(policy.weights[:-1], policy.biases[:-1], strict=True):
        layer = np.tanh(layer @ weight.T + bias)
    expected = layer @ policy.weights[-1].T + policy.biases[-1]
    assert policy.means(seen) == pytest.approx(expected, abs=1e-4)


class Failing(Reach):
    """Raises in a step that a test chooses."""

    made: ClassVar[list["Failing"]] = []
    left = 0

    def __init__(self, copies: int, threads: int) -> None:
        super().__init__(copies, threads)
        self.made.append(self)

    def judge(self, copies: Any) -> Outcome:
        self.left -= 1
        if self.left == 0:
            raise ArithmeticError("the ball is square")
        return super().judge(copies)


def test_after_an_exception_a_collector_begins_anew_and_repeats_the_iteration() -> None:
    with collector_of(partial(reaching, Failing)) as collector:
        collector.collect(policies(2)[0], steps=STEPS)
        Failing.made.pop().left = 3
        with pytest.raises(ArithmeticError, match="square"):
            collector.collect(policies(2)[1], steps=STEPS)
        again = collector.collect(policies(2)[1], steps=STEPS)
        assert collector.iteration == 2
    with collector_of(iteration=1) as fresh:
        wanted = fresh.collect(policies(2)[1], steps=STEPS)
    assert_same(dict(arrays_of(again)), dict(arrays_of(wanted)), "rollout")


def test_arrays_are_read_only_and_shared_by_nobody() -> None:
    arrays = [array for each in collected(2) for _, array in arrays_of(each)]
    assert not any(array.flags.writeable for array in arrays)
    assert not any(np.shares_memory(a, b) for a, b in combinations(arrays, 2) if a.size and b.size)


class Chance:
    """A policy of discrete actions, of one's own."""

    def sample(self, observations: Any, generator: Any) -> Any:
        return generator.integers(0, 3, len(observations)), np.full(len(observations), -math.log(3))


class Plain(Goal):
    """Observations without names."""

    def __init__(self, copies: int) -> None:
        super().__init__(copies)
        self.observation_space = Box(-9, 9, (6,), np.float32)

    def observe(self, copies: Any) -> Any:
        return Reach.observe(self, copies)


def test_a_policy_may_be_of_ones_own_with_discrete_actions() -> None:
    make = lambda: VectorEnvironment(Plain(3), autoreset_mode="SameStep")  # noqa: E731
    with Collector(make, seed=1) as collector:
        rollout = collector.collect(Chance(), steps=20)
    assert set(rollout.actions.ravel().tolist()) == {0, 1, 2}
    assert rollout.actions.dtype == Discrete(3).dtype


def test_mistakes_are_named() -> None:
    policy = policies(1)[0]
    with pytest.raises(o80.InvalidArgument, match=r"SameStep, these are in NextStep: make them"):
        Collector(lambda: VectorEnvironment(Reach(2)))
    with pytest.raises(o80.InvalidArgument, match="observation_space of arrays"):
        Collector(lambda: VectorEnvironment(Goal(2), autoreset_mode="SameStep"))
    with pytest.raises(o80.InvalidArgument, match="number must be at least 0, got -1"):
        Collector(reaching, number=-1)
    with Collector(reaching, infos=("distance",)) as collector:
        with pytest.raises(o80.InvalidArgument, match=r"no array 'distance' .* it has apart, "):
            collector.collect(policy, steps=20)
        with pytest.raises(o80.InvalidArgument, match="steps must be at least 1, got 0"):
            collector.collect(policy, steps=0)
    for use in (lambda: collector.collect(policy, steps=1), lambda: collector.restart(1)):
        with pytest.raises(o80.Closed, match="make a new one"):
            use()
    with pytest.raises(o80.InvalidArgument, match=r"log_std must have shape \(4,\), got \(3,\)"):
        GaussianPolicy(policy.mean, policy.scale, policy.weights, policy.biases, policy.log_std[:3])
    with pytest.raises(o80.InvalidArgument, match=r"weights must have the shapes \[\(32, 6\)"):
        GaussianPolicy(policy.mean, policy.scale, policy.weights[1:], policy.biases, policy.log_std)
