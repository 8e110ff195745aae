"""A learned policy is two small files, and plays with NumPy alone."""

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from o80_table_tennis.players.conditions import Conditions
from o80_table_tennis.players.learned_policy import LearnedPolicy
from o80_table_tennis.players.network import Network

INPUTS, HIDDEN, ACTIONS = 7, 5, 8


def network(seed: int = 1) -> Network:
    rng = np.random.default_rng(seed)
    sizes = [INPUTS, HIDDEN, HIDDEN, ACTIONS]
    return Network.of_arrays(
        {
            "visible": np.ones(INPUTS),
            "mean": rng.normal(size=INPUTS),
            "scale": rng.uniform(0.5, 2.0, INPUTS),
            **{f"weight_{i}": rng.normal(size=(sizes[i + 1], sizes[i])) for i in range(3)},
            **{f"bias_{i}": rng.normal(size=sizes[i + 1]) for i in range(3)},
        }
    )


def policy() -> LearnedPolicy:
    return LearnedPolicy(network(), Conditions(factor=0.4, balls="narrow"), {"seed": 3})


def test_a_saved_policy_is_the_same_when_it_is_loaded(tmp_path: Path) -> None:
    saved = policy()
    saved.save(tmp_path / "policy.npz")
    for name in ("policy", "policy.npz", "policy.json"):
        loaded = LearnedPolicy.load(tmp_path / name)
        assert loaded.conditions == saved.conditions
        assert loaded.training == saved.training
        observation = np.linspace(-3, 3, INPUTS, dtype=np.float32)
        assert loaded.act(observation).tobytes() == saved.act(observation).tobytes()


def test_actions_lie_in_the_box_and_are_of_one_kind_for_one_and_for_many() -> None:
    observations = np.random.default_rng(2).normal(0, 100, (50, INPUTS)).astype(np.float32)
    many = network().act(observations)
    assert many.dtype == np.float32
    assert np.abs(many).max() == 1.0
    for observation, action in zip(observations, many, strict=True):
        np.testing.assert_allclose(network().act(observation), action, atol=1e-4)


def test_what_is_masked_changes_no_action() -> None:
    visible = np.ones(INPUTS, np.float32)
    visible[2:4] = 0
    blind = replace(network(), visible=visible)
    first = np.zeros(INPUTS, np.float32)
    second = first.copy()
    second[2:4] = 5.0
    assert blind.act(first).tobytes() == blind.act(second).tobytes()
    second[0] = 0.1
    assert blind.act(first).tobytes() != blind.act(second).tobytes()


def test_a_missing_file_is_named_with_what_would_make_it(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"policy\.npz.*o80_table_tennis\.train"):
        LearnedPolicy.load(tmp_path / "policy")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda told: told.update(format=2), "format 2 is not 1"),
        (lambda told: told["conditions"].update(wind=1), "unknown conditions: wind"),
        (lambda told: told.pop("conditions"), "conditions"),
    ],
)
def test_a_file_of_another_version_is_refused(
    tmp_path: Path, change: Callable[[dict[str, Any]], Any], message: str
) -> None:
    policy().save(tmp_path / "policy")
    path = tmp_path / "policy.json"
    told = json.loads(path.read_text())
    change(told)
    path.write_text(json.dumps(told))
    with pytest.raises(ValueError, match=message):
        LearnedPolicy.load(path)


def test_arrays_that_do_not_fit_each_other_or_are_not_finite_are_refused(tmp_path: Path) -> None:
    arrays = network().arrays()
    with pytest.raises(ValueError, match=r"layer 1 must have shape \(5, 5\)"):
        Network.of_arrays(arrays | {"weight_1": np.zeros((HIDDEN, HIDDEN + 1))})
    with pytest.raises(ValueError, match="finite"):
        Network.of_arrays(arrays | {"mean": np.full(INPUTS, np.nan)})


def test_playing_a_policy_loads_no_learning_library() -> None:
    code = (
        "import sys, o80_table_tennis.players.learned_policy, o80_table_tennis.environment\n"
        "assert not {'torch', 'stable_baselines3'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
