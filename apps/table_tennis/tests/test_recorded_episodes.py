"""Recordings of environments: every row, every episode, what each step was worth."""

from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from opened_environment import PATIENT, PUSH, STILL, WAITING, opened, played_out

import o80
from o80.hybrid import relive
from o80.recording.recorded_epoch import RecordedEpoch
from o80_table_tennis.copies import TableTennisCopies
from o80_table_tennis.report.recorded_episodes import RecordedEpisode, recorded_episodes
from o80_table_tennis.settings import Pacing, TaskSettings

SHORT = 200  # rows of a history


@pytest.mark.parametrize("pacing", [Pacing.INLINE, Pacing.PROCESSES])
def test_no_row_is_lost_where_the_history_is_short(pacing: Pacing, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with opened(pacing, record=path, history=SHORT) as environment:
        for _ in range(3):
            environment.reset(seed=1)
            played_out(environment)
        published = environment.arm.published

    assert published > 5 * SHORT
    recording = o80.open(path)
    for name in recording:
        rows = recording[name].history()
        np.testing.assert_array_equal(rows.iteration, np.arange(len(rows)))
    assert len(recording[next(iter(recording))].history()) == published + 1


@pytest.mark.parametrize("pacing", list(Pacing))
def test_an_episode_comes_back_as_it_was_played(pacing: Pacing, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    rng = np.random.default_rng(3)
    with opened(pacing, record=path) as environment:
        first, _ = environment.reset(seed=7, options={"ball": 3})
        actions: list[Any] = []
        steps: list[Any] = []
        while not steps or not (steps[-1][2] or steps[-1][3]):
            actions.append(rng.uniform(-1, 1, 8).astype(np.float32))
            steps.append(environment.step(actions[-1]))
        summary = environment.summary
        observations = [first.copy(), *(step[0].copy() for step in steps)]
        first[:] = steps[0][0][:] = 7.0  # the caller's own

    (episode,) = recorded_episodes(path)
    assert episode.summary == summary
    assert episode.pacing == pacing.value
    assert (episode.begun["seed"], episode.begun["task"]) == (7, "return")
    assert summary.ball == 3
    assert set(episode.drawn) == {"goal", "extra_balls", "arm_seed", "twin_seed"}
    assert episode.rewards.sum() == summary.reward
    assert episode.environment["task"]["factor"] == PATIENT.factor
    np.testing.assert_array_equal(episode.actions, actions)
    np.testing.assert_array_equal(episode.rewards, [step[1] for step in steps])
    np.testing.assert_array_equal(episode.observations, observations)
    check_rows(episode)


def check_rows(episode: RecordedEpisode) -> None:
    """One row before the first step, five for each step, and the twin is the arm."""
    rows = 5 * episode.summary.steps + 1
    for history in (episode.arm, episode.twin):
        np.testing.assert_array_equal(np.diff(history.iteration), 1)
        assert len(history) == rows
    mirrored = episode.twin.observed.joints["position"][1:]
    np.testing.assert_array_equal(mirrored, episode.arm.extended.joint_positions[1:])
    assert episode.balls.shape == (rows, 1, 3)
    assert episode.times[-1] == pytest.approx((rows - 1) * episode.period)


def test_each_environment_continues_the_file(tmp_path: Path) -> None:
    path, history = tmp_path / "run.mcap", RecordedEpoch.history
    for pacing in (Pacing.INLINE, Pacing.PROCESSES):
        with opened(pacing, record=path) as environment:
            for _ in range(2):
                environment.reset(seed=1)
                played_out(environment)

    with patch.object(RecordedEpoch, "history", autospec=True, side_effect=history) as decoded:
        episodes = recorded_episodes(path)
    assert decoded.call_count == 4, "each run of arm and twin once"
    found = [(each.pacing, each.summary.number) for each in episodes]
    assert found == [(pacing, n) for pacing in ("inline", "processes") for n in (0, 1)]
    for one, other in zip(episodes[:2], episodes[2:], strict=True):
        assert one.arm.observed.tobytes() == other.arm.observed.tobytes()
        assert one.balls.tobytes() == other.balls.tobytes()


def test_an_abandoned_episode_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with opened(record=path) as environment:
        environment.reset(seed=1)
        environment.step(PUSH)
        environment.reset()
        played_out(environment)

    assert [episode.summary.number for episode in recorded_episodes(path)] == [1]
    with pytest.raises(o80.InvalidArgument, match="accepts the argument `recorded`"):
        next(relive(path, TableTennisCopies))


def test_a_stalled_episode_is_recorded_as_such(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    task = TaskSettings(max_late=200)
    with opened(Pacing.REAL_TIME, task=task, record=path) as environment:
        environment.reset(seed=1)
        environment.step(STILL)
        arm = environment.arm
        arm.wait_for(arm.published + 250, timeout=WAITING)
        _, reward, terminated, truncated, info = environment.step(STILL)
        assert (reward, terminated, truncated, info["stalled"]) == (0.0, False, True, True)
        assert environment.statistics().stalled_episodes == 1

    (episode,) = recorded_episodes(path)
    assert (episode.summary.end, episode.summary.terminated) == ("stalled", False)
    assert len(episode.actions) == len(episode.rewards) == episode.summary.steps
