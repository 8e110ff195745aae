"""A training runs, writes its files, and goes on from a checkpoint as if it had not stopped."""

import json
import math
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import typer
from typer.testing import CliRunner

import o80
from o80_table_tennis import train
from o80_table_tennis.learning import checkpoint, curve, seeds
from o80_table_tennis.learning.curve import CURVE
from o80_table_tennis.learning.settings import WAYS, LearningSettings, PpoSettings
from o80_table_tennis.learning.training import POLICY, Training
from o80_table_tennis.learning.visible_numbers import BALL_PARTS
from o80_table_tennis.players.learned_policy import LearnedPolicy
from o80_table_tennis.task.full_observation import FullObservation

pytestmark = pytest.mark.check  # needs torch, which only `make check` installs

SMALL = LearningSettings(
    ppo=PpoSettings(environments=2, steps=32, batch=32, epochs=2, hidden=8),
    decisions=128,
    evaluate_every=64,
    evaluated=2,
)


@pytest.fixture(autouse=True)
def one_thread() -> None:
    torch.set_num_threads(1)


def test_a_training_writes_a_row_for_each_update_a_policy_and_a_checkpoint(tmp_path: Path) -> None:
    told: list[curve.CurvePoint] = []
    with Training(SMALL, tmp_path) as training:
        policy = training.run(told.append)
    points = curve.read(tmp_path / CURVE)
    assert [point.decisions for point in points] == [64, 128]
    assert [point.decisions for point in told] == [64, 128]
    assert all(point.evaluated for point in points)
    assert all(0 < point.environment < 1 for point in points)
    assert checkpoint.found(tmp_path) is not None
    loaded = LearnedPolicy.load(tmp_path / POLICY)
    assert loaded.conditions == SMALL.conditions
    observation = np.ones(loaded.network.inputs, np.float32)
    assert loaded.act(observation).tobytes() == policy.act(observation).tobytes()


@pytest.mark.parametrize("last", [None, -2.0])
def test_exploration_falls_with_the_decisions_unless_it_is_learned(
    last: float | None, tmp_path: Path
) -> None:
    settings = replace(SMALL, ppo=replace(SMALL.ppo, last_log_exploration=last), decisions=256)
    with Training(replace(settings, decisions=128), tmp_path) as training:
        training.run()
    with Training(settings, tmp_path, resume=True) as training:
        training.run()
    explored = [point.exploration for point in curve.read(tmp_path / CURVE)]
    # half of the first training had been made before its second rollout, and so on
    expected = [np.exp(-0.5 + (last or 0.0) * share + 0.5 * share) for share in (0, 0.5, 0.5, 0.75)]
    falls = np.allclose(explored, expected, rtol=1e-5)
    assert falls == (last is not None)


def test_a_training_leaves_no_temporary_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    monkeypatch.delenv("SB3_LOGDIR", raising=False)
    with Training(SMALL, tmp_path / "training") as training:
        training.run()
    with Training(replace(SMALL, decisions=192), tmp_path / "training", resume=True) as resumed:
        resumed.run()
    assert not list(temporary.iterdir())


def test_the_policy_of_numpy_acts_as_the_one_that_was_trained(tmp_path: Path) -> None:
    with Training(SMALL, tmp_path) as training:
        policy = training.run()
        environments = training.model.get_vec_normalize_env()
        assert environments is not None
        rng = np.random.default_rng(1)
        space = training.model.observation_space
        seen = rng.uniform(-2, 2, (500, *(space.shape or ()))).astype(np.float32)
        expected, _ = training.model.predict(environments.normalize_obs(seen), deterministic=True)
        np.testing.assert_allclose(policy.network.act(seen), expected, atol=2e-6)
        assert np.ptp(expected) > 0


def state_of(training: Training) -> list[bytes]:
    """All that decides how a training goes on, except for its episodes, which begin anew."""
    environments = training.model.get_vec_normalize_env()
    assert environments is not None
    statistics: Any = environments.obs_rms
    policy = training.model.policy
    optimiser = policy.optimizer.state_dict()["state"]
    moments = [values for _, state in sorted(optimiser.items()) for values in state.values()]
    return [
        *(values.detach().numpy().tobytes() for values in policy.state_dict().values()),
        *(values.numpy().tobytes() for values in moments),
        *(values.tobytes() for values in (statistics.mean, statistics.var)),
        torch.get_rng_state().numpy().tobytes(),
    ]


def test_a_resumed_training_has_weights_optimiser_normalisation_and_generators(
    tmp_path: Path,
) -> None:
    with Training(SMALL, tmp_path) as training:
        training.run()
        before, spent = state_of(training), training.progress
    saved = json.loads((tmp_path / checkpoint.FOLDER / checkpoint.PROGRESS).read_text())
    with Training(replace(SMALL, decisions=192), tmp_path, resume=True) as resumed:
        assert state_of(resumed) == before
        assert resumed.progress.decisions == spent.decisions
        assert resumed.progress.episodes == spent.episodes
        assert resumed.progress.minutes >= saved["minutes"] > 0
        resumed.run()
        assert state_of(resumed) != before
    assert [point.decisions for point in curve.read(tmp_path / CURVE)] == [64, 128, 192]


def test_a_training_that_has_nothing_left_to_do_tells_no_share_of_the_environments(
    tmp_path: Path,
) -> None:
    with Training(SMALL, tmp_path) as training:
        training.run()
    with Training(SMALL, tmp_path, resume=True) as training:
        training.run()
        assert math.isnan(training.environment_share)


def test_the_same_seed_and_the_same_resumption_learn_the_same(tmp_path: Path) -> None:
    ended = []
    for folder in (tmp_path / "one", tmp_path / "two"):
        with Training(SMALL, folder) as training:
            training.run()
        with Training(replace(SMALL, decisions=192), folder, resume=True) as resumed:
            resumed.run()
            ended.append(state_of(resumed))
    assert ended[0] == ended[1]


def test_rows_after_the_checkpoint_are_dropped_when_a_training_resumes(tmp_path: Path) -> None:
    with Training(SMALL, tmp_path) as training:
        training.run()
        last = training.point(evaluate=False)
    curve.append(tmp_path / CURVE, replace(last, decisions=500))  # killed before the checkpoint
    with Training(SMALL, tmp_path, resume=True):
        assert [point.decisions for point in curve.read(tmp_path / CURVE)] == [64, 128]


def test_a_training_that_is_stopped_leaves_a_checkpoint(tmp_path: Path) -> None:
    def stop(point: curve.CurvePoint) -> None:
        raise KeyboardInterrupt

    with Training(SMALL, tmp_path) as training, pytest.raises(KeyboardInterrupt):
        training.run(stop)
    with Training(SMALL, tmp_path, resume=True) as resumed:
        assert resumed.progress.decisions == 64


def test_a_training_resumes_that_was_stopped_before_its_first_update(tmp_path: Path) -> None:
    with Training(SMALL, tmp_path) as training:
        training.save()
    with Training(SMALL, tmp_path, resume=True) as resumed:
        resumed.run()
    assert [point.decisions for point in curve.read(tmp_path / CURVE)] == [64, 128]


def test_a_checkpoint_is_replaced_as_a_whole(tmp_path: Path) -> None:
    with Training(SMALL, tmp_path) as training:
        training.run()
    folder = checkpoint.found(tmp_path)
    assert folder is not None
    folder.rename(tmp_path / f"{checkpoint.FOLDER}.old")  # killed between the two renames
    (tmp_path / f"{checkpoint.FOLDER}.new").mkdir()
    with Training(SMALL, tmp_path, resume=True) as resumed:
        assert resumed.progress.decisions == 128


def test_a_folder_without_a_checkpoint_cannot_be_resumed(tmp_path: Path) -> None:
    with pytest.raises(o80.InvalidArgument, match="no checkpoint to resume"):
        Training(SMALL, tmp_path, resume=True)


def test_a_blind_policy_does_not_see_the_ball(tmp_path: Path) -> None:
    with Training(replace(SMALL, blind=True), tmp_path) as training:
        network = training.run().network
        environments = training.model.get_vec_normalize_env()
        assert environments is not None
        statistics: Any = environments.obs_rms
    places = FullObservation().places()
    first = np.zeros(network.inputs, np.float32)
    second = first.copy()
    for part in BALL_PARTS:
        assert not statistics.mean[places[part]].any()  # always 0
        second[places[part]] = 1.0
    assert set(places) - set(BALL_PARTS) == {
        *("joint_positions", "joint_velocities", "pressures", "asked", "changes", "racket", "time")
    }
    assert network.act(first).tobytes() == network.act(second).tobytes()


def test_a_training_ends_when_its_time_is_spent(tmp_path: Path) -> None:
    with Training(replace(SMALL, minutes=1e-9, decisions=10**6), tmp_path) as training:
        training.run()
        assert training.progress.decisions <= 64


def test_curves_are_read_as_they_were_written(tmp_path: Path) -> None:
    path = tmp_path / "curve.csv"
    point = curve.CurvePoint(10, 2, 2, 0.5, 0.25, 0.5, 0.25, -0.125, 0.75, 1, 0.5)
    seen = replace(
        point, decisions=20, evaluated_touched=1, evaluated_returned=0.5, evaluated_reward=1.5
    )
    for each in (point, seen):
        curve.append(path, each)
    first, second = curve.read(path)
    assert not first.evaluated
    assert math.isnan(first.evaluated_reward)
    assert second == seen
    path.write_text("something,else\n")
    with pytest.raises(ValueError, match="not a learning curve"):
        curve.read(path)


@pytest.mark.parametrize("name", WAYS)
def test_every_way_can_be_trained(tmp_path: Path, name: str) -> None:
    way = WAYS[name]
    few = replace(way.ppo, environments=1, steps=4, batch=4)
    settings = replace(way, ppo=few, decisions=4, evaluate_every=4, evaluated=1)
    with Training(settings, tmp_path) as training:
        training.run()


def test_the_command_trains_and_tells_how_well(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(WAYS, "ours", SMALL)
    arguments = ["--seed", "5", "--evaluated", "2", "--blind-share", "0.5"]
    app = typer.Typer()
    app.command()(train.main)
    result = CliRunner().invoke(app, [*arguments, "--output", str(tmp_path)])
    assert result.exit_code == 0, result.output
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["seed"] == 5
    assert report["decisions"] == 128
    assert report["minutes"] > 0
    for name in ("returned_simulated", "returned_blind"):
        assert 0 <= report[name] <= 1
    assert report["returned_recorded"] is None
    for name in ("curve.png", "landings.png", "policy.npz", "policy.json", "curve.csv"):
        assert (tmp_path / name).stat().st_size > 100
    assert 0 < report["environment_share"] < 1
    share = "of the processor time was spent in the environments"
    for words in (share, "learned", "blind", "still arm", "random actions"):
        assert words in result.output

    compared = typer.Typer()
    compared.command()(seeds.main)
    picture = tmp_path / "seeds.png"
    result = CliRunner().invoke(compared, [str(tmp_path), "--picture", str(picture)])
    assert result.exit_code == 0, result.output
    assert f"median {100 * report['returned_simulated']:.1f} %" in result.output
    assert picture.stat().st_size > 1000


def test_a_training_resumes_that_was_stopped_before_its_blind_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Training(SMALL, tmp_path) as training:
        training.run()
    monkeypatch.setitem(WAYS, "ours", SMALL)
    app = typer.Typer()
    app.command()(train.main)
    arguments = ["--resume", "--evaluated", "1", "--blind-share", "0.5", "--output", str(tmp_path)]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert (tmp_path / "blind" / "policy.npz").is_file()


def test_a_missing_library_is_named_with_its_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "torch", None)
    app = typer.Typer()
    app.command()(train.main)
    result = CliRunner().invoke(app, ["--output", str(tmp_path)])
    assert result.exit_code == 1
    assert 'pip install "o80-table-tennis[learn]"' in result.output


def test_an_unknown_way_is_refused_with_those_there_are() -> None:
    with pytest.raises(ValueError, match="unknown way 'hers'; there are: ours, published"):
        train.chosen("hers", balls=None, minutes=None)


@pytest.mark.check
@pytest.mark.timeout(600)
def test_a_short_training_learns_to_touch_the_ball(tmp_path: Path) -> None:
    settings = LearningSettings(decisions=300_000, evaluate_every=300_000, evaluated=200)
    with Training(settings, tmp_path) as training:
        training.run()
    points = curve.read(tmp_path / CURVE)
    last = points[-1]
    first = next(point for point in points if point.episodes >= 500)
    # how many depends on the processor: bits of NumPy and torch differ
    assert last.touched > first.touched
    assert last.evaluated_touched > first.touched
