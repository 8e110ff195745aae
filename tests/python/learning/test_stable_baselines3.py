"""Vector environments under the learners of Stable-Baselines3."""

from typing import Any

import numpy as np
import pytest
from learning_tasks import Goal, Reach
from vector_equality import assert_same

import o80
from o80.learning import Environment, VectorEnvironment

pytestmark = pytest.mark.check  # needs Stable-Baselines3, which only `make check` installs
COPIES = 4


def adapted(task: Any, infos: Any = "all", **options: Any) -> Any:
    vector = VectorEnvironment(task, autoreset_mode="SameStep", **options)
    return o80.learning.stable_baselines3(vector, infos=infos)


def plain(value: Any) -> Any:
    """Without NumPy's scalars and without clock times."""
    if isinstance(value, dict):
        return {name: plain(each) for name, each in value.items() if name != "t"}
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    return value.item() if isinstance(value, np.generic) else value


@pytest.mark.parametrize("task", [Reach, Goal])
def test_does_what_a_dummy_vec_env_of_monitored_environments_does(task: type[Reach]) -> None:
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.vec_env import DummyVecEnv

    singles = DummyVecEnv([lambda: Monitor(Environment(task()))] * COPIES)
    copies = adapted(task(COPIES))
    for each in (copies, singles):
        each.seed(7)
        each.action_space.seed(1)
    seen = [plain(each.reset()) for each in (copies, singles)]
    assert_same(seen[0], seen[1], "first observations")
    ends = 0
    for _ in range(80):
        actions = np.array([copies.action_space.sample() for _ in range(COPIES)])
        results, others = copies.step(actions), singles.step(actions)
        ends += int(results[2].sum())
        assert results[1].dtype == others[1].dtype == np.float32
        assert_same(plain(results), plain(others), "results")
        assert_same(plain(copies.reset_infos), plain(singles.reset_infos), "reset infos")
    assert ends > 3 * COPIES
    copies.close()
    singles.close()


def test_gives_infos_of_ended_episodes_only_if_told_so() -> None:
    copies = adapted(Reach(COPIES, max_steps=3), infos="ends")
    copies.seed(1)
    copies.reset()
    still = np.zeros((COPIES, 4), np.float32)
    assert copies.step(still)[3] == [{"TimeLimit.truncated": False}] * COPIES
    copies.step(still)
    last = copies.step(still)[3]
    assert all(info["TimeLimit.truncated"] and info["episode"]["l"] == 3 for info in last)
    assert all(info["steps"] == 3 and info["terminal_observation"].shape == (6,) for info in last)
    copies.close()


def test_options_attributes_methods_and_pictures_are_those_of_the_task() -> None:
    task = Reach(COPIES)
    copies = adapted(task, render_mode="rgb_array")
    copies.set_options({"goal": (0.5, 0.25)})
    copies.reset()
    assert (task.goals == [0.5, 0.25]).all()
    copies.reset()
    assert (task.goals != [0.5, 0.25]).all(), "options hold for one reset"
    assert copies.get_attr("max_steps", indices=[0, 2]) == [9, 9]
    copies.set_attr("max_steps", 5)
    assert task.max_steps == 5
    assert [len(rows) for rows in copies.env_method("flagged")] == [COPIES] * COPIES
    assert copies.render().shape[2] == 3
    with pytest.raises(o80.InvalidArgument, match="all copies share 'max_steps'"):
        copies.set_attr("max_steps", 5, indices=[1])
    copies.set_options([{"goal": (0.5, 0.25)}, {}, {}, {}])
    with pytest.raises(o80.InvalidArgument, match="the same options"):
        copies.reset()
    copies.close()


def test_another_autoreset_mode_is_refused() -> None:
    with (
        VectorEnvironment(Reach(2)) as vector,
        pytest.raises(o80.InvalidArgument, match="autoreset_mode='SameStep'"),
    ):
        o80.learning.stable_baselines3(vector)
