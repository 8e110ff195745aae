"""Recorded experiments repeat bit for bit, and a change of the arm's muscles is found at once."""

import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from opened_environment import PUSH, WAITING, opened

import o80
from o80_table_tennis.environment import TableTennisEnvironment
from o80_table_tennis.players.policies import DEFAULT_FACTOR, default_policy
from o80_table_tennis.playing import play
from o80_table_tennis.report.recorded_episodes import recorded_episodes
from o80_table_tennis.settings import Pacing, RigSettings, TaskSettings
from o80_table_tennis.world.arm import MUSCLES

ROOT = Path(__file__).resolve().parents[3]
LATE_BY = 7  # rows
LATE_STEPS = (5, 20)
STEPS = 40
EPISODES = 20

MUSCLE = "src/pam/muscle.cpp"
FORCE = "{.force = resting_force(length, activation)}"
STRONGER = "(activation > {threshold} ? 1.0 + 1e-12 : 1.0)"


def play_late(environment: TableTennisEnvironment, *, seed: int) -> None:
    """Steps of random actions, of which some are sent after the iteration they were meant for."""
    rng = np.random.default_rng(seed)
    environment.reset(seed=seed)
    for step in range(STEPS):
        if step in LATE_STEPS:
            row = environment.task.single.span[2]
            environment.arm.wait_for(row + LATE_BY, timeout=WAITING)
        environment.step(rng.uniform(-1, 1, MUSCLES).astype(np.float32))


def test_a_run_in_real_time_with_late_actions_and_resets_replays_bit_for_bit(
    tmp_path: Path,
) -> None:
    path = tmp_path / "run.mcap"
    with opened(Pacing.REAL_TIME, record=path) as environment:
        for episode in range(2):
            play_late(environment, seed=episode)
        assert environment.statistics().late_actions >= 2 * len(LATE_STEPS)
        published = [environment.arm.published, environment.twins[0].published]

    report = o80.replay(path)
    assert report.identical, report
    arm, twin = report.runs
    assert arm.rows > published[0]
    assert twin.rows == published[1] + 1


@pytest.mark.parametrize(
    "pacing", [Pacing.INLINE, pytest.param(Pacing.PROCESSES, marks=pytest.mark.check)]
)
def test_twenty_accelerated_episodes_replay_bit_for_bit(pacing: Pacing, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    rig = RigSettings(pacing=pacing, start_noise=0.02)
    with TableTennisEnvironment(
        rig=rig, task=TaskSettings(factor=DEFAULT_FACTOR), record=path
    ) as environment:
        play(environment, default_policy(), range(EPISODES), seed=1)

    assert len(recorded_episodes(path)) == EPISODES
    report = o80.replay(path)
    assert report.identical, report
    assert len(report.runs) == 2


@pytest.mark.parametrize("arm", [{"muscle": "hill"}, {"preset": "identified"}])
def test_other_arms_replay_bit_for_bit(arm: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with opened(record=path, start_noise=0.02, **arm) as environment:
        for episode in range(2):
            environment.reset(seed=episode)
            for _ in range(STEPS):
                environment.step(PUSH)

    report = o80.replay(path)
    assert report.identical, report


def arm_with_changed_muscles(folder: Path, *, threshold: float) -> Path:
    """Builds the arm from a copy of its sources.

    In the copy, muscles of an activation above the threshold pull by one part in 10^12 more.
    """
    sources, build = folder / "pam", folder / "build"
    shutil.copytree(ROOT / "robots" / "pam" / "src", sources / "src")
    shutil.copy(ROOT / "robots" / "pam" / "CMakeLists.txt", sources)
    muscle = sources / MUSCLE
    text = muscle.read_text()
    assert text.count(FORCE) == 1, f"{MUSCLE} no longer has the line that this test changes"
    changed = FORCE.replace("}", f" * {STRONGER.format(threshold=threshold.hex())}}}")
    muscle.write_text(text.replace(FORCE, changed))
    prefix = Path(o80.__file__).parent
    for command in (
        ["cmake", "-S", str(sources), "-B", str(build), f"-Do80_ROOT={prefix}"],
        ["cmake", "--build", str(build), "--target", "pam"],
    ):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    (library,) = build.rglob("*pam.so")
    return library


@pytest.mark.check
def test_a_changed_line_of_the_muscles_is_found_at_the_first_iteration_it_touches(
    tmp_path: Path,
) -> None:
    path = tmp_path / "run.mcap"
    with opened(record=path) as environment:
        for episode in range(2):
            environment.reset(seed=episode)
            for _ in range(STEPS):
                environment.step(PUSH)
        arm = environment.arm.segment

    # the last iteration in which some muscle was more active than ever before
    strongest = o80.open(path)[arm].history().extended.activations.max(axis=1)
    before = np.maximum.accumulate(strongest)
    touched = int(np.flatnonzero(strongest[1:] > before[:-1])[-1]) + 1
    assert touched > 50
    library = arm_with_changed_muscles(tmp_path, threshold=float(before[touched - 1]))

    report = o80.replay(path, segment=arm, robot=library)
    assert report.difference is not None
    assert report.difference.iteration == touched
    assert o80.replay(path, segment=arm).identical
