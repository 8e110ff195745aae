"""The baselines: a still arm, random actions."""

import numpy as np
import pytest

from o80_table_tennis.players.policies import Policy, RandomPolicy, StillPolicy
from o80_table_tennis.task.observations import SIZE


def observed(y: float, vy: float, joint: float = 0.0) -> np.ndarray:
    """A ball at y with the speed vy, joint 1 at an angle."""
    row = np.zeros(SIZE, np.float32)
    row[0], row[17], row[20] = joint, y, vy
    return row


@pytest.mark.parametrize("policy", [StillPolicy(), RandomPolicy(seed=1)])
def test_actions_lie_in_the_box(policy: Policy) -> None:
    policy.reset()
    for _ in range(20):
        action = policy.act(observed(0.5, -4.0))
        assert action.shape == (8,)
        assert action.dtype == np.float32
        assert np.abs(action).max() <= 1.0


def test_random_actions_follow_their_seed_and_go_on_over_episodes() -> None:
    first, again = RandomPolicy(seed=3), RandomPolicy(seed=3)
    one = first.act(observed(1, -4))
    np.testing.assert_array_equal(one, again.act(observed(1, -4)))
    first.reset()
    assert not np.array_equal(one, first.act(observed(1, -4)))
