"""Recorded experiments repeat bit for bit, and a change of the arm's muscles is found at once."""

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

LATE_BY = 7  # rows
LATE_STEPS = (5, 20)
STEPS = 40
EPISODES = 20


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
