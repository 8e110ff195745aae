"""Any task is trained by one call: it learns, resumes bit for bit, and updates between episodes."""

from __future__ import annotations

import contextlib
import json
import os
import pty
import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import training_tasks
from training_tasks import Guess, Near, OnTheClock, Squared

import o80
from o80.learning.training import (
    CurvePoint,
    LearnedPolicy,
    NamedTask,
    Training,
    TrainingSettings,
    curve,
    evaluate,
    session,
)
from o80.learning.training.learner import load

pytestmark = pytest.mark.check  # needs torch, which only `make check` installs

SMALL = {"rollout": 48, "batch_size": 16, "n_epochs": 2, "hidden": 8}
SETTINGS = TrainingSettings(Guess, seed=4, copies=4, decisions=480, ppo=SMALL)


def trained(folder: Path, settings: TrainingSettings = SETTINGS) -> dict[str, Any]:
    """Trains or resumes; the outcome."""
    there = (folder / "checkpoint.pt").exists()
    with Training(settings, folder, resume=there) as training:
        training.run()
    return outcome(folder)


def outcome(folder: Path) -> dict[str, Any]:
    """All that was learned: bits of the weights and of the last episodes, and the curve, but for
    times.
    """
    _, state = load(folder)
    learner, policy = state["learner"], LearnedPolicy.load(folder)
    points = curve.points(folder / "curve.csv", CurvePoint)
    return {
        "weights": {name: values.numpy().tobytes() for name, values in learner["weights"].items()},
        "generators": (learner["torch"].numpy().tobytes(), learner["numpy"], learner["python"]),
        "window": state["window"].numpy().tobytes(),
        "policy": [weight.tobytes() for weight in policy.network.weights],
        "curve": [(each.decisions, each.episodes, each.reward, each.success) for each in points],
        "training": policy.training,
    }


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_it_learns_more_than_doing_nothing_or_anything(tmp_path: Path) -> None:
    ppo = {"rollout": 512, "batch_size": 64, "learning_rate": 3e-3}
    with Training(TrainingSettings(Guess, copies=8, decisions=8_000, ppo=ppo), tmp_path) as new:
        new.run()
    points = curve.points(tmp_path / "curve.csv", CurvePoint)
    learned, nothing, random = evaluate([tmp_path, "nothing", "random"], episodes=100)
    for baseline in (nothing, random):
        gain, half = learned.gain(baseline)
        assert gain - half > 0
        assert learned.interval[0] > baseline.interval[1]
    assert points[-1].success > points[0].success


@pytest.mark.parametrize("copies", [1, 4])
@pytest.mark.parametrize("draw", range(3))
def test_an_interrupted_training_learns_what_an_uninterrupted_one_does(
    copies: int, draw: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session, "RENEWED", 3)
    settings = replace(SETTINGS, copies=copies)
    expected = trained(tmp_path / "whole", settings)
    assert len(expected["curve"]) >= 9

    random = np.random.default_rng(draw)
    for _ in range(4):
        after = int(random.integers(2 * settings.decisions // 3))
        interruptions = iter([False] * after + [True])
        monkeypatch.setattr(training_tasks, "interruptions", interruptions)
        with contextlib.suppress(KeyboardInterrupt):
            trained(tmp_path / "parts", settings)
    monkeypatch.setattr(training_tasks, "interruptions", iter(()))
    assert trained(tmp_path / "parts", settings) == expected


def test_a_training_that_fails_or_is_killed_in_an_update_learns_the_same(tmp_path: Path) -> None:
    expected = trained(tmp_path / "whole")

    def fail(point: CurvePoint) -> None:
        if point.decisions > 100:
            shutil.copytree(tmp_path / "parts", tmp_path / "killed")
            raise ArithmeticError

    with Training(SETTINGS, tmp_path / "parts") as training:
        with pytest.raises(ArithmeticError):
            training.run(fail)
        with pytest.raises(o80.Closed):
            training.run()
    assert LearnedPolicy.load(tmp_path / "parts").training["decisions"] == 96
    assert LearnedPolicy.load(tmp_path / "killed").training["decisions"] == 0
    assert trained(tmp_path / "parts") == trained(tmp_path / "killed") == expected


def test_the_last_episodes_outlive_a_resume_and_a_training_can_be_made_longer(
    tmp_path: Path,
) -> None:
    trained(tmp_path)
    with Training(replace(SETTINGS, decisions=528), tmp_path, resume=True) as longer:
        assert len(longer.window.rows) == 160
        longer.run()
        assert longer.window.episodes == len(longer.window.rows) == 176
    assert len(curve.points(tmp_path / "curve.csv", CurvePoint)) == 11


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"seed": 3}, r"seed \(4, not 3\)"),
        ({"copies": 2}, "copies"),
        ({"task": Near}, "name .*training_tasks:Guess.*, not .*Near"),
        ({"task": NamedTask(Guess, {"offset": 0.5})}, r"options \({}, not {'offset': 0.5}\)"),
        ({"task": NamedTask(Guess, imported={"rule": Squared})}, "imported"),
        ({"task": NamedTask(Guess, success="touched")}, "success"),
        ({"ppo": SMALL | {"gamma": 0.5}}, "gamma"),
    ],
)
def test_other_settings_are_refused_before_anything_is_written(
    changed: dict[str, Any], named: str, tmp_path: Path
) -> None:
    trained(tmp_path)
    before = files(tmp_path)
    with pytest.raises(o80.InvalidArgument, match=f"trained with another {named}"):
        Training(replace(SETTINGS, **changed), tmp_path, resume=True)
    with pytest.raises(o80.InvalidArgument, match=f"resume {tmp_path}"):
        Training(replace(SETTINGS, **changed), tmp_path)
    assert files(tmp_path) == before


@pytest.mark.parametrize(
    ("task", "message"),
    [
        ("training_tasks:Guesses", "no class or function 'Guesses'.*Did you mean 'Guess'"),
        ("training_task:Guess", "'training_task:Guess' cannot be imported"),
        ("nowhere.py:Guess", "nowhere.py:Guess' cannot be imported"),
        ("Guess", "unknown task 'Guess': give the id"),
        ("mine/Unknown-v7", "'mine/Unknown-v7' cannot be made"),
        (NamedTask(Guess, {"ofset": 1}), "Guess' cannot be made with .*ofset=1"),
        ("training_tasks:Words", "'training_tasks:Words' must have actions in a Box.*Discrete"),
        ("training_tasks:three", "'training_tasks:three' must make .* with 4 copies"),
        (NamedTask(Guess, success="touched"), "no array 'touched' at the end.*is_success"),
    ],
)
def test_what_cannot_be_trained_is_named(task: Any, message: str, tmp_path: Path) -> None:
    with (
        pytest.raises(o80.InvalidArgument, match=message),
        Training(TrainingSettings(task, copies=4, decisions=48, ppo=SMALL), tmp_path) as training,
    ):
        training.run()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: NamedTask(Guess, imported={"rule": "training_tasks:Cubed"}), "'Cubed'"),
        (lambda: NamedTask(Guess, imported={"rule": "training_tasks:NeedsMore"}), "NeedsMore"),
        (lambda: NamedTask(Guess, {"rule": Squared()}), "option 'rule' .*--import"),
        (lambda: NamedTask(Guess, imported={"rule": Squared()}), "Squared object.*top of a module"),
        (lambda: NamedTask(lambda copies: None), "top of a module"),
        (lambda: TrainingSettings(Guess, ppo={"gama": 0.5}), "no 'gama'.*gamma"),
        (lambda: TrainingSettings(Guess, ppo={"hidden": 0}), "hidden must be at least 1"),
        (
            lambda: TrainingSettings(Guess, ppo={"learning_rate": -1}),
            "learning_rate must be a finite",
        ),
        (lambda: Training(TrainingSettings(Guess), "/dev/null/x"), "/dev/null/x cannot be written"),
    ],
)
def test_wrong_settings_are_refused_before_anything_is_trained(make: Any, message: str) -> None:
    with pytest.raises(o80.InvalidArgument, match=message):
        TrainingSettings(make())


def test_a_checkpoint_of_another_version_is_refused(tmp_path: Path) -> None:
    (tmp_path / "checkpoint.pt").write_bytes(b"not one")
    with pytest.raises(o80.InvalidArgument, match=r"checkpoint\.pt: not a checkpoint"):
        Training(None, tmp_path)


def test_torch_has_one_thread_while_it_trains(tmp_path: Path) -> None:
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    counts: list[int] = []
    try:
        with Training(SETTINGS, tmp_path) as training:
            training.run(lambda point: counts.append(torch.get_num_threads()))
        assert set(counts) == {1}
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(before)


def test_the_policy_of_numpy_acts_as_the_one_that_was_trained(tmp_path: Path) -> None:
    with Training(SETTINGS, tmp_path) as training:
        policy = training.run()
        normalisation = training.learner.get_vec_normalize_env()
        assert normalisation is not None
        seen = np.linspace(-1, 1, 50, dtype=np.float32)[:, np.newaxis]
        expected, _ = training.learner.predict(
            normalisation.normalize_obs(seen), deterministic=True
        )
    np.testing.assert_allclose(policy.act(seen), 5 + 5 * expected, atol=1e-5)
    assert np.ptp(expected) > 0


@pytest.mark.parametrize("task", [Near, "training_tasks:training_tasks/Near-v0"])
def test_a_task_of_a_group_is_trained_by_its_class_or_id(task: Any, tmp_path: Path) -> None:
    settings = TrainingSettings(task, copies=4, decisions=96, ppo=SMALL)
    trained(tmp_path, settings)
    (last,) = curve.points(tmp_path / "curve.csv", CurvePoint)[1:]
    assert last.length == 8
    assert np.isnan(last.success)  # its info does not say


def test_on_the_clock_no_step_follows_an_update_within_an_episode(
    tmp_path: Path, segment: str
) -> None:
    training_tasks.events.clear()
    task = NamedTask(OnTheClock, {"segment": segment})
    settings = TrainingSettings(task, copies=1, decisions=36, ppo=SMALL | {"rollout": 12})

    with Training(settings, tmp_path) as training:
        update = training.learner.train

        def noted() -> None:
            training_tasks.events.append("update")
            update()

        training.learner.train = noted  # type: ignore[method-assign]
        training.run()

    episode = ["begin", *["step"] * 5]
    rollout = [*episode * 3, "update"]  # of at least 12 steps
    assert training_tasks.events == rollout * 3
    points = curve.points(tmp_path / "curve.csv", CurvePoint)
    assert [each.decisions for each in points] == [15, 30, 45]
    # a step of real time lasts 20 iterations at 1000 Hz
    assert all(each.play_hours * 3600 >= each.decisions * 0.019 for each in points)
    assert points[-1].minutes * 60 >= (points[-1].play_hours + points[-1].reset_hours) * 3600


def test_a_file_of_settings_is_trained_and_words_of_the_command_replace_its_values(
    tmp_path: Path,
) -> None:
    task: dict[str, Any] = {"name": "training_tasks:Guess"}
    task["imported"] = {"rule": "training_tasks:Squared"}
    held = {"task": task, "copies": 4, "decisions": 96, "seed": 9, "ppo": SMALL}
    (tmp_path / "guess.json").write_text(json.dumps(held))
    words = [sys.executable, "-m", "o80.learning", "train", str(tmp_path / "guess.json")]
    words += ["--out", str(tmp_path / "out"), "--seed", "3", "--ppo", "gamma=0.5"]
    subprocess.run(words, cwd=Path(__file__).parents[1], check=True, capture_output=True)
    settings, _ = load(tmp_path / "out")
    wanted = TrainingSettings(NamedTask(**task), 3, 4, 96, {**SMALL, "gamma": 0.5})
    assert settings == wanted
    for name, message in (
        ("none.json", "No such file"),
        ("training_tasks:none.json", "not settings of a training"),
        ("no_package:none.json", "no_package"),
    ):
        with pytest.raises(o80.InvalidArgument, match=message):
            TrainingSettings.of_file(name)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_stopped_command_saves_and_says_how_to_go_on(
    number: signal.Signals, tmp_path: Path
) -> None:
    folder = tmp_path / "out"
    words = [sys.executable, "-m", "o80.learning", "train", "training_tasks:Guess"]
    words += ["--out", str(folder), "--copies", "4", "--import", "rule=training_tasks:Squared"]
    for name, value in SMALL.items():
        words += ["--ppo", f"{name}={value}"]
    here = Path(__file__).parents[1]
    terminal, inside = pty.openpty()
    errors = inside if number == signal.SIGHUP else subprocess.PIPE
    heard = partial(signal.signal, number, signal.SIG_DFL)  # nohup and & ignore two of them
    with subprocess.Popen(
        words, stdout=inside, stderr=errors, cwd=here, preexec_fn=heard
    ) as process:
        os.close(inside)
        said = b""
        while b"decisions" not in said:
            said += os.read(terminal, 1000)
        if number == signal.SIGHUP:
            os.close(terminal)  # from here on a line to it fails
        process.send_signal(number)
        _, text = process.communicate(timeout=120)
        assert process.returncode == 128 + number
    if number != signal.SIGHUP:
        os.close(terminal)
        assert f"python -m o80.learning resume {folder}" in text.decode()
    settings, state = load(folder)
    assert settings.task.imported == {"rule": "training_tasks:Squared"}
    saved = LearnedPolicy.load(folder)
    assert saved.training["decisions"] == state["learner"]["decisions"]
    assert saved.task.name == "training_tasks:Guess"
