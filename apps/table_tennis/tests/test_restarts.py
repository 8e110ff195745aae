"""A network that has got stuck is replaced by a new one while the training goes on."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from o80_table_tennis.learning import curve
from o80_table_tennis.learning.curve import CURVE
from o80_table_tennis.learning.learner import begin_anew
from o80_table_tennis.learning.settings import WAYS, LearningSettings, PpoSettings, RestartSettings
from o80_table_tennis.learning.training import Training

pytestmark = pytest.mark.check  # needs torch, which only `make check` installs

UPDATE = 256
"""Decisions, in which at least one episode ends."""
SMALL = LearningSettings(
    ppo=PpoSettings(environments=2, steps=UPDATE // 2, batch=32, epochs=2, hidden=8),
    decisions=5 * UPDATE,
    evaluate_every=10**6,
    evaluated=2,
)
IMPATIENT = replace(SMALL, restart=RestartSettings(after=UPDATE, touched=1.0))
"""Replaces every network that misses a ball."""


@pytest.fixture(autouse=True)
def one_thread() -> None:
    torch.set_num_threads(1)


@pytest.mark.parametrize(
    ("begun", "decisions", "touched", "expected"),
    [
        (0, 599_999, 0.1, False),  # too early
        (0, 600_000, 0.1, True),
        (0, 600_000, 0.65, False),
        (0, 602_047, 0.1, True),  # still the first update after 600 000
        (0, 602_048, 0.1, False),
        (600_000, 1_200_000, 0.1, True),
        (1_800_000, 2_400_000, 0.1, True),
        (600_000, 800_000, 0.1, False),
        (1_800_001, 2_400_001, 0.1, False),  # no time left for a new one
        (0, 600_000, math.nan, False),
    ],
)
def test_a_network_is_judged_once_and_only_if_a_new_one_has_time(
    begun: int, decisions: int, touched: float, expected: bool
) -> None:
    settings = LearningSettings(decisions=3_000_000)
    judged = {"begun": begun, "decisions": decisions, "touched": touched}
    assert settings.stuck(**judged) is expected  # type: ignore[arg-type]
    assert not replace(settings, blind=True).stuck(**judged)  # type: ignore[arg-type]


def test_the_published_way_replaces_no_network() -> None:
    assert WAYS["published"].restart.touched == 0
    assert WAYS["ours"].restart.touched > 0


def test_a_stuck_network_is_replaced_while_decisions_go_on(tmp_path: Path) -> None:
    with Training(IMPATIENT, tmp_path / "anew") as training:
        training.run()
        assert training.progress.restarts == 4
        assert training.policy.training["restarts"] == 4
    points = curve.read(tmp_path / "anew" / CURVE)
    assert [point.decisions for point in points] == [UPDATE * each for each in range(1, 6)]
    assert [point.restarts for point in points] == [0, 1, 2, 3, 4]
    start = points[0].exploration
    assert [point.exploration == start for point in points] == [True] * 5

    with Training(SMALL, tmp_path / "kept") as training:
        training.run()
    kept = curve.read(tmp_path / "kept" / CURVE)
    assert [point.restarts for point in kept] == [0] * 5
    assert kept[1].exploration != start


def test_a_new_network_has_other_weights_and_an_optimiser_of_its_own(tmp_path: Path) -> None:
    with Training(SMALL, tmp_path) as training:
        training.run()
        model = training.model
        before = [each.detach().clone() for each in model.policy.parameters()]
        begin_anew(model)
        after = list(model.policy.parameters())
        for old, new in zip(before, after, strict=True):
            assert old.shape == new.shape
        assert not torch.equal(before[1], after[1])  # 0 is the exploration, whose start is given
        optimiser = model.policy.optimizer
        assert not optimiser.state_dict()["state"]
        optimised = {id(each) for group in optimiser.param_groups for each in group["params"]}
        assert optimised == {id(each) for each in after}


def test_a_training_that_was_stopped_with_a_stuck_network_resumes_with_a_new_one(
    tmp_path: Path,
) -> None:
    def stop(point: curve.CurvePoint) -> None:
        raise KeyboardInterrupt

    with Training(IMPATIENT, tmp_path) as training, pytest.raises(KeyboardInterrupt):
        training.run(stop)
    with Training(replace(IMPATIENT, decisions=3 * UPDATE), tmp_path, resume=True) as resumed:
        assert resumed.progress.stuck
        resumed.run()
        assert resumed.progress.restarts == 2
    assert [point.restarts for point in curve.read(tmp_path / CURVE)] == [0, 1, 2]


def test_settings_of_restarts_are_checked() -> None:
    with pytest.raises(ValueError, match=r"touched must lie in \[0, 1\], got 2"):
        RestartSettings(touched=2)
    with pytest.raises(ValueError, match="after"):
        RestartSettings(after=0)
