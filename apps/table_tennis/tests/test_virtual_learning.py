"""SAC with virtual balls: the fast update, and whole trainings, small ones."""

import math
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
import typer
from gymnasium import spaces
from rich.console import Console
from stable_baselines3 import SAC
from stable_baselines3.common.logger import Logger
from typer.testing import CliRunner

import o80
from o80_table_tennis.learning import curve
from o80_table_tennis.learning.virtual import __main__ as command
from o80_table_tennis.learning.virtual import curves
from o80_table_tennis.learning.virtual.comparison import PICTURE, run
from o80_table_tennis.learning.virtual.curves import Point
from o80_table_tennis.learning.virtual.fast_sac import FastSac
from o80_table_tennis.learning.virtual.settings import WAYS, SacSettings, VirtualSettings
from o80_table_tennis.learning.virtual.training import train

pytestmark = pytest.mark.check  # needs torch, which only `make check` installs

SMALL = VirtualSettings(
    motions=4,
    random_motions=2,
    evaluate_every=2,
    evaluated=2,
    sac=SacSettings(buffer=5000, batch=16, hidden=8),
)


@pytest.fixture(autouse=True)
def one_thread() -> None:
    torch.set_num_threads(1)


class Spaces(gymnasium.Env[Any, Any]):
    observation_space = spaces.Box(-1, 1, (5,), np.float32)
    action_space = spaces.Box(-1, 1, (8,), np.float32)


def learned(kind: type[SAC], updates: int, **optimizer: Any) -> SAC:
    """After updates on the same random transitions."""
    sac = kind(
        "MlpPolicy",
        Spaces(),
        buffer_size=500,
        learning_rate=1e-3,
        ent_coef="auto_0.1",
        policy_kwargs={"net_arch": [16, 16], "optimizer_kwargs": optimizer},
        seed=1,
        device="cpu",
    )
    sac.set_logger(Logger(None, []))
    buffer: Any = sac.replay_buffer
    generator = np.random.default_rng(0)
    for name in ("observations", "next_observations", "rewards", "actions"):
        array = getattr(buffer, name)
        array[:] = generator.uniform(-1, 1, array.shape)
    buffer.dones[:] = generator.random(buffer.dones.shape) < 0.3
    buffer.full = True
    sac.train(updates, 64)
    return sac


def parameters(sac: SAC) -> list[torch.Tensor]:
    assert sac.log_ent_coef is not None
    return [*sac.policy.state_dict().values(), sac.log_ent_coef.detach()]


def test_the_fast_update_is_that_of_stable_baselines3() -> None:
    slow, fast = learned(SAC, 30), learned(FastSac, 30, fused=True)
    start = learned(FastSac, 0)
    for theirs, ours, before in zip(
        parameters(slow), parameters(fast), parameters(start), strict=True
    ):
        assert not torch.equal(ours, before)
        torch.testing.assert_close(ours, theirs, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("way", WAYS)
def test_a_training_repeats_itself_and_counts_what_it_learned_from(way: str) -> None:
    settings = replace(SMALL, way=way)
    points = train(settings)
    again = train(settings)
    assert [point.motions for point in points] == [2, 4]
    assert [point.gradient_steps for point in points] == [0, 2 * WAYS[way].gradient_steps]
    for point, other in zip(points, again, strict=True):
        assert replace(point, processor_minutes=0.0) == replace(other, processor_minutes=0.0)
        assert 0 <= point.returned <= point.touched <= 1
        assert math.isfinite(point.reward)


def test_more_balls_give_more_transitions_of_as_many_motions() -> None:
    seen = {way: train(replace(SMALL, way=way))[0].transitions for way in WAYS}
    assert seen["none"] == seen["more_steps"]
    assert 3 * seen["none"] < seen["selected"] < seen["all"]
    assert seen["all"] > 15 * seen["none"]


def test_curves_are_written_whole_and_read_again(tmp_path: Path) -> None:
    path = curves.file_of(tmp_path, "none", 3)
    points = [Point(50, 0.25, 0.125, -0.5, 1000, 0, 0.75), Point(100, 0.5, 0.25, 0.5, 2000, 9, 1.5)]
    for point in points:
        curve.append(path, point)
    assert curves.read(path) == points
    other = curves.file_of(tmp_path, "none", 4)
    curve.append(other, points[1])
    found = curves.found(tmp_path, "none")
    assert curves.common_motions(found) == [100]
    assert curves.column(found, "returned").tolist() == [[0.25], [0.25]]
    path.write_text("something else\n")
    with pytest.raises(ValueError, match=r"none-3.csv: not a learning curve of this version"):
        curves.read(path)


def test_a_comparison_goes_on_where_it_was_stopped_and_draws_what_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "o80_table_tennis.learning.virtual.comparison.VirtualSettings",
        lambda way, seed, **rest: replace(SMALL, way=way, seed=seed, **rest),
    )
    done = curves.file_of(tmp_path, "none", 1)
    curve.append(done, Point(4, 0.5, 0.5, 0.5, 1, 1, 1.0))
    before = done.read_bytes()
    done.with_name("all-1.part").write_text("of a training that was killed\n")
    run(["none", "all"], [1], tmp_path, Console(), motions=4)
    assert done.read_bytes() == before
    assert [point.motions for point in curves.read(tmp_path / "all-1.csv")] == [2, 4]
    assert not list(tmp_path.glob("*.part"))
    app = typer.Typer()
    app.command()(command.main)
    result = CliRunner().invoke(app, ["--plot-only", "--output", str(tmp_path)])
    assert result.exit_code == 0, result.output
    assert (tmp_path / PICTURE).stat().st_size > 10_000


def test_an_unknown_way_is_named_with_those_that_there_are() -> None:
    with pytest.raises(ValueError, match="unknown way 'some'; there are: none, more_steps, all"):
        VirtualSettings(way="some")


@pytest.mark.check
def test_a_comparison_that_is_terminated_leaves_no_segment(tmp_path: Path) -> None:
    module = "o80_table_tennis.learning.virtual"
    arguments = ["--way", "none", "--seed", "1", "--output", str(tmp_path)]
    process = subprocess.Popen([sys.executable, "-m", module, *arguments])

    def left() -> list[str]:
        return [each.name for each in o80.segments() if f"-{process.pid}-" in each.name]

    try:
        while process.poll() is None and len(left()) < 2:  # arm and twin
            time.sleep(0.05)
        process.terminate()
        assert process.wait() == 128 + signal.SIGTERM
        assert not left()
    finally:
        process.kill()
        process.wait()
