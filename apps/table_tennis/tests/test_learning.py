"""Table tennis as a task of o80.learning's trainer: its settings, a short training, its policy."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from o80.learning.training import Training, TrainingSettings, curve, make_vec
from o80_table_tennis.players.conditions import Conditions
from o80_table_tennis.players.learned_policy import TASK, LearnedPolicy
from o80_table_tennis.playing import evaluate

pytestmark = pytest.mark.check  # needs torch, which only `make check` installs

FILES = sorted(f"o80_table_tennis.learning:{name}.json" for name in ("ours", "published"))


@pytest.mark.parametrize("file", FILES)
def test_each_file_of_settings_makes_its_copies(file: str) -> None:
    settings = TrainingSettings.of_file(file)
    assert settings.task.name == TASK
    copies = settings.task.make_vec(2, AutoresetMode.SAME_STEP)
    copies.reset(seed=1)
    *_, infos = copies.step(np.zeros((2, 8), np.float32))
    assert settings.task.success in infos
    copies.close()


def test_the_goal_of_a_training_is_one_of_its_options() -> None:
    copies = make_vec(TASK, 1, goal="smash", balls="narrow")
    assert type(copies.task.task).__name__ == "SmashTask"  # type: ignore[attr-defined]
    copies.close()


@pytest.mark.timeout(600)
def test_a_short_training_earns_more_than_at_its_beginning_and_its_policy_plays(
    tmp_path: Path,
) -> None:
    settings = replace(TrainingSettings.of_file(FILES[0]), decisions=150_000)
    with Training(settings, tmp_path) as training:
        training.run()
    points = curve.points(tmp_path / curve.CURVE, curve.CurvePoint)
    first = next(point for point in points if point.episodes >= 500)
    assert points[-1].reward > first.reward  # by how much depends on the processor's bits
    policy = LearnedPolicy.load(tmp_path)
    assert policy.conditions == Conditions()
    assert len(evaluate(policy, policy.conditions, balls=2).episodes) == 2
