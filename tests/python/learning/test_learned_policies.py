"""Tasks by name, learned policies as two files that NumPy plays, paired evaluations."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import training_tasks
from gymnasium.spaces import Box
from hypothesis import given
from hypothesis import strategies as st
from processes import run_python
from training_tasks import Guess, Near, OfItsOwn

import o80
from o80.learning.rollouts import GaussianPolicy
from o80.learning.rollouts.rollout import Ends
from o80.learning.training import (
    CurvePoint,
    LearnedPolicy,
    NamedTask,
    curve,
    evaluate,
    make_vec,
    wilson,
)
from o80.learning.training.curve import LAST, EpisodeWindow, success_share


def policy(inputs: int = 1) -> LearnedPolicy:
    space = Box(np.array([0.0, -4.0], np.float32), np.array([10.0, 4.0], np.float32))
    network = GaussianPolicy.new(inputs, 2, hidden=(8,), seed=3)
    return LearnedPolicy(network, space, NamedTask(Guess, {"offset": 0.5}), {"copies": 3})


@pytest.mark.parametrize(
    "task",
    [
        *(Guess, Near, OfItsOwn, "training_tasks:Guess", f"{training_tasks.__file__}:Near"),
        *("training_tasks/Near-v0", "training_tasks:training_tasks/Near-v0", "Pendulum-v1"),
    ],
)
@pytest.mark.parametrize("mode", ["SameStep", "Disabled"])
def test_every_kind_of_task_makes_copies_in_the_mode_that_is_asked_for(
    task: Any, mode: str
) -> None:
    environments = make_vec(task, 2, autoreset_mode=mode)
    assert environments.num_envs == 2
    assert environments.metadata["autoreset_mode"].value == mode
    environments.close()


def test_a_saved_policy_is_the_same_when_it_is_loaded(tmp_path: Path) -> None:
    saved = policy()
    saved.save(tmp_path / "policy.npz")
    seen = np.linspace(-3, 3, 7, dtype=np.float32)[:, np.newaxis]
    for name in ("policy", "policy.npz", "policy.json", ""):
        for place in (tmp_path / name, str(tmp_path / name)):
            loaded = LearnedPolicy.load(place)
            assert loaded.act(seen).tobytes() == saved.act(seen).tobytes()
            assert (loaded.task, loaded.training) == (saved.task, saved.training)
    assert saved.act(seen).dtype == np.float32
    assert saved.action_space.contains(saved.act(seen[0] * 1e9))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda told: told.update(format=2), "format 2 is not 1"),
        (lambda told: told.pop("task"), "task"),
        (lambda told: told["task"].update(wind=1), "wind"),
    ],
)
def test_a_policy_of_another_version_is_refused(
    tmp_path: Path, change: Callable[[dict[str, Any]], Any], message: str
) -> None:
    policy().save(tmp_path / "policy")
    path = tmp_path / "policy.json"
    told = json.loads(path.read_text())
    change(told)
    path.write_text(json.dumps(told))
    with pytest.raises(o80.InvalidArgument, match=message):
        LearnedPolicy.load(path)
    (tmp_path / "policy.npz").unlink()
    with pytest.raises(
        o80.InvalidArgument, match=r"policy\.npz: no such file.*o80\.learning train"
    ):
        LearnedPolicy.load(path)


def test_playing_a_policy_loads_no_learning_library() -> None:
    code = (
        "import sys, o80.learning.training\nassert not {'torch', 'matplotlib'} & set(sys.modules)"
    )
    run_python("-c", code)


def test_every_policy_plays_the_same_episodes_whatever_the_number_of_copies() -> None:
    task = NamedTask(Guess, imported={"rule": training_tasks.Squared})
    one = evaluate(["nothing", "random"], task=task, episodes=12, copies=1)
    many = evaluate(["nothing", "random"], task=task, episodes=12, copies=5)
    for alone, together in zip(one, many, strict=True):
        np.testing.assert_array_equal(alone.rewards, together.rewards)
        assert (together.lengths == 3).all()
    nothing, random = many
    # the action 0 is apart by 5 and twice the number that is drawn: episodes differ
    assert len(set(nothing.rewards)) == 12
    assert nothing.success == 0.0
    assert nothing.interval == pytest.approx((0.0, 0.242494), abs=1e-6)
    gain, half = random.gain(nothing)
    assert gain == pytest.approx(random.rewards.mean() - nothing.rewards.mean())
    assert half > 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"policies": ["nothing"]}, "give task"),
        ({"policies": ["large"]}, "3 observed numbers and 2 actions, the task has 1 and 1"),
        ({"policies": ["nothing"], "task": NamedTask(Near), "episodes": 0}, "episodes"),
        ({"policies": ["nothing"], "task": NamedTask(Guess, success="hit")}, "'hit'.*is_success"),
    ],
)
def test_mistakes_of_an_evaluation_are_named(
    arguments: Any, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    policy(inputs=3).save("large")
    with pytest.raises(o80.InvalidArgument, match=message):
        evaluate(**arguments)


def test_the_window_keeps_the_last_episodes_and_counts_all() -> None:
    window = EpisodeWindow()
    assert all(map(math.isnan, window.means()))
    for number in range(3):
        count = np.full(LAST // 2, number)
        told = {"is_success": np.full(LAST // 2, None if number == 1 else True, object)}
        window.add(Ends(count, count, count * 1.0, count, count, told), "is_success")
    assert (window.episodes, len(window.rows)) == (3 * LAST // 2, LAST)
    assert window.means() == (0.5, 1.5, 1.5)
    assert math.isnan(success_share(np.full(3, np.nan)))


def test_a_curve_is_read_as_it_was_written_cut_and_drawn(tmp_path: Path) -> None:
    path = tmp_path / "curve.csv"
    rows = [CurvePoint(n, n, 0.5, 0.25, 1.0, math.nan, -1.5, 3.0, 0.5) for n in (1, 2, 3)]
    for row in rows:
        curve.append(path, row)
    with path.open("a") as file:
        file.write("4,4,0.5")  # a kill
    curve.cut(path, CurvePoint, 2)
    assert [str(each) for each in curve.points(path, CurvePoint)] == [
        str(each) for each in rows[:2]
    ]
    curve.draw(tmp_path / "curve.png", {"one": rows})
    assert (tmp_path / "curve.png").stat().st_size > 1000
    path.write_text("something,else\n")
    with pytest.raises(o80.InvalidArgument, match="not a learning curve"):
        curve.points(path, CurvePoint)


@pytest.mark.parametrize(
    ("successes", "count", "low", "high"),
    # Brown, Cai, DasGupta (2001) and R's binom.confint(method="wilson")
    [(0, 10, 0.0, 0.27753), (5, 10, 0.23659, 0.76341), (10, 10, 0.72247, 1.0), (0, 0, 0.0, 1.0)],
)
def test_known_intervals(successes: int, count: int, low: float, high: float) -> None:
    assert wilson(successes, count) == pytest.approx((low, high), abs=1e-5)


@given(count=st.integers(1, 10**6), share=st.floats(0, 1))
def test_it_holds_the_share_and_narrows_with_the_count(count: int, share: float) -> None:
    successes = round(share * count)
    low, high = wilson(successes, count)
    assert 0 <= low <= successes / count <= high <= 1
    many_low, many_high = wilson(4 * successes, 4 * count)
    assert many_high - many_low < high - low


def test_more_than_all_is_refused() -> None:
    with pytest.raises(ValueError, match="between 0 and 3, got 4"):
        wilson(4, 3)
