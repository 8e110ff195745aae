"""Compares a vector environment with Gymnasium's SyncVectorEnv of single environments."""

from collections.abc import Callable
from operator import methodcaller
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv

MODES = list(AutoresetMode)
Policy = Callable[[Any, int], Any]
"""Maps all copies' observations and the step number to actions."""


def beside(
    vector: VectorEnv[Any, Any, Any],
    make: Callable[[], gymnasium.Env[Any, Any]],
    policy: Policy,
    *,
    steps: int,
    seed: Any,
) -> int:
    """Steps both, resets ended copies in DISABLED mode; returns the number of ended episodes."""
    mode = vector.metadata["autoreset_mode"]
    singles: Any = SyncVectorEnv([make] * vector.num_envs, autoreset_mode=mode)
    try:
        assert_same_spaces(vector, singles)
        seen = both(vector, singles, lambda each: each.reset(seed=seed))[0]
        ends = 0
        for number in range(steps):
            actions = policy(seen, number)
            results = both(vector, singles, methodcaller("step", actions))
            seen, over = results[0], results[2] | results[3]
            ends += int(over.sum())
            assert_final_observations(vector, results, mode)
            if mode is AutoresetMode.DISABLED and over.any():
                again = {"reset_mask": over}
                seen = both(vector, singles, lambda each: each.reset(options=dict(again)))[0]  # noqa: B023
        assert vector.np_random_seed == singles.np_random_seed
        generators: Any = vector.np_random
        for mine, other in zip(generators, singles.np_random, strict=True):
            assert mine.bit_generator.state == other.bit_generator.state
        return ends
    finally:
        singles.close()


def both(vector: Any, singles: Any, call: Callable[[Any], Any]) -> Any:
    """Calls both, asserts equal results, and returns them."""
    results, others = call(vector), call(singles)
    assert_same(results, others, "results")
    return results


def assert_same_spaces(vector: Any, singles: Any) -> None:
    for name in (
        "observation_space",
        "action_space",
        "single_observation_space",
        "single_action_space",
        "num_envs",
        "render_mode",
    ):
        assert getattr(vector, name) == getattr(singles, name), name
    assert vector.metadata["autoreset_mode"] is singles.metadata["autoreset_mode"]


def assert_final_observations(vector: Any, results: Any, mode: AutoresetMode) -> None:
    """Asserts that final observations equal Gymnasium's, or the result's."""
    dense, infos = vector.final_observations, results[4]
    if mode is not AutoresetMode.SAME_STEP:
        assert_same(dense, results[0], "final observations")
        return
    for copy in np.flatnonzero(infos.get("_final_obs", [])).tolist():
        assert_same(row(dense, copy), infos["final_obs"][copy], "final observation")


def row(batch: Any, copy: int) -> Any:
    if isinstance(batch, dict):
        return {name: row(each, copy) for name, each in batch.items()}
    return batch[copy]


def assert_same(one: Any, other: Any, where: str) -> None:
    """Asserts equal types, keys, shapes, dtypes and bits."""
    assert type(one) is type(other), f"{where}: {type(one)}, {type(other)}"
    if isinstance(one, dict):
        assert one.keys() == other.keys(), where
        for name in one:
            assert_same(one[name], other[name], f"{where}.{name}")
    elif isinstance(one, tuple | list):
        assert len(one) == len(other), where
        for number, (mine, theirs) in enumerate(zip(one, other, strict=True)):
            assert_same(mine, theirs, f"{where}[{number}]")
    elif isinstance(one, np.ndarray):
        assert one.dtype == other.dtype, f"{where}: {one.dtype}, {other.dtype}"
        assert one.shape == other.shape, f"{where}: {one.shape}, {other.shape}"
        if one.dtype == object:
            assert_same(list(one), list(other), where)
        else:
            assert one.tobytes() == other.tobytes(), f"{where}:\n{one}\n{other}"
    else:
        assert one == other, f"{where}: {one}, {other}"
