"""The learned policy in the package, and those of o80.learning's trainer: what they play in."""

import json
from pathlib import Path
from typing import Any

import pytest

from o80_table_tennis.players.conditions import Conditions
from o80_table_tennis.players.learned_policy import SHIPPED, LearnedPolicy, shipped_policy
from o80_table_tennis.playing import evaluate


def test_the_shipped_policy_returns_balls_in_the_conditions_of_its_training() -> None:
    policy = shipped_policy()
    assert policy.conditions == Conditions()
    assert evaluate(policy, policy.conditions, balls=6).returned >= 0.5


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
