"""The learned policy in the package, and those of o80.learning's trainer: what they play in."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from o80_table_tennis.learning.evaluation import evaluate
from o80_table_tennis.players.conditions import Conditions
from o80_table_tennis.players.learned_policy import SHIPPED, LearnedPolicy, shipped_policy


def test_the_shipped_policy_returns_balls_in_the_conditions_of_its_training() -> None:
    policy = shipped_policy()
    assert policy.conditions == Conditions()
    assert evaluate("learned", policy, policy.conditions, balls=6).returned >= 0.5


def test_actions_are_of_one_kind_for_one_and_for_many() -> None:
    policy = shipped_policy()
    observations = np.random.default_rng(2).normal(0, 3, (20, 73)).astype(np.float32)
    many = policy.act(observations)
    assert (many.shape, many.dtype) == ((20, 8), np.dtype(np.float32))
    assert np.abs(many).max() == 1.0
    for observation, action in zip(observations, many, strict=True):
        np.testing.assert_allclose(policy.act(observation), action, atol=1e-4)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"name": "o80/CartPole-v0"}, "was trained for 'o80/CartPole-v0', not for 'o80_table"),
        ({"wind": 1}, "not a policy of this version"),
    ],
)
def test_a_policy_of_another_task_is_refused(
    tmp_path: Path, change: dict[str, Any], message: str
) -> None:
    (tmp_path / "policy.npz").write_bytes(SHIPPED.with_suffix(".npz").read_bytes())
    told = json.loads(SHIPPED.with_suffix(".json").read_text())
    told["task"] |= change
    (tmp_path / "policy.json").write_text(json.dumps(told))
    with pytest.raises(ValueError, match=message):
        LearnedPolicy.load(tmp_path)


def test_playing_a_policy_loads_no_learning_library() -> None:
    code = (
        "import sys, o80_table_tennis.players.learned_policy, o80_table_tennis.environment\n"
        "assert not {'torch', 'stable_baselines3'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
