"""A training whose rollouts are collected by several workers."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import typer
from ray_cluster import ray_cluster
from typer.testing import CliRunner

from o80.learning.rollouts import LocalWorkers
from o80_table_tennis import train
from o80_table_tennis.learning import curve, workers
from o80_table_tennis.learning.curve import CURVE
from o80_table_tennis.learning.settings import LearningSettings, PpoSettings
from o80_table_tennis.learning.training import POLICY, Training

pytestmark = pytest.mark.check  # needs torch, which only `make check` installs

SMALL = LearningSettings(
    ppo=PpoSettings(environments=4, steps=48, batch=64, epochs=2, hidden=8),
    decisions=3 * 192,
    evaluate_every=10**6,
    evaluated=2,
    actors=2,
)


@pytest.fixture(autouse=True)
def one_thread() -> None:
    torch.set_num_threads(1)


@pytest.fixture
def local(monkeypatch: pytest.MonkeyPatch) -> None:
    """Workers of this process instead of Ray's, whose rollouts are the same."""
    monkeypatch.setattr(workers, "RayWorkers", LocalWorkers)


def trained(settings: LearningSettings, folder: Path, *, resume: bool = False) -> bytes:
    with Training(settings, folder, resume=resume) as training:
        policy = training.run()
        assert training.model.num_timesteps == settings.decisions
    return b"".join(array.tobytes() for array in policy.network.arrays().values())


def test_a_training_with_workers_is_repeatable_and_counts_episodes(
    local: None, tmp_path: Path
) -> None:
    assert trained(SMALL, tmp_path / "one") == trained(SMALL, tmp_path / "two")
    points = curve.read(tmp_path / "one" / CURVE)
    assert [point.decisions for point in points] == [192, 384, 576]
    assert points[-1].episodes >= 4
    assert np.isfinite(points[-1].reward)
    assert np.isnan(points[-1].environment)
    assert (tmp_path / "one" / POLICY).is_file()


def test_a_blind_training_with_workers_gives_the_ball_no_weight(
    local: None, tmp_path: Path
) -> None:
    with Training(replace(SMALL, blind=True, decisions=192), tmp_path) as training:
        network = training.run().network
    hidden = network.visible == 0
    assert hidden.any()
    assert not network.mean[hidden].any()


def test_it_resumes_where_its_workers_begin_anew(local: None, tmp_path: Path) -> None:
    for name in ("one", "two"):
        trained(replace(SMALL, decisions=192), tmp_path / name)
    some = trained(SMALL, tmp_path / "one", resume=True)
    assert some == trained(SMALL, tmp_path / "two", resume=True)
    assert [point.decisions for point in curve.read(tmp_path / "one" / CURVE)] == [192, 384, 576]


def test_actors_must_divide_the_environments(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="actors must divide the 4 environments, got 3"):
        replace(SMALL, actors=3)
    app: Any = typer.Typer()
    app.command()(train.main)
    ran = CliRunner().invoke(app, ["--actors", "7", "--output", str(tmp_path)])
    assert ran.exit_code == 1
    assert "actors must divide the" in ran.output


@pytest.fixture
def cluster() -> Iterator[Any]:
    pytest.importorskip("ray")
    with ray_cluster() as started:
        yield started


@pytest.mark.check
@pytest.mark.timeout(600)
def test_a_training_by_actors_of_ray_is_that_by_workers_of_this_process(
    cluster: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    by_actors = trained(SMALL, tmp_path / "actors")
    monkeypatch.setattr(workers, "RayWorkers", LocalWorkers)
    assert trained(SMALL, tmp_path / "local") == by_actors
