"""After the first touch the ball flies to its end in the same step, as it would have by itself."""

from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from opened_environment import ALL_MODES, opened

import o80
from o80_table_tennis.environment import TableTennisEnvironment
from o80_table_tennis.players.policies import default_policy
from o80_table_tennis.report.recorded_episodes import recorded_episodes
from o80_table_tennis.settings import Pacing, RigSettings, TaskSettings
from o80_table_tennis.task.actions import COARSE
from o80_table_tennis.task.end import End
from o80_table_tennis.world.arm import MUSCLES

Step = tuple[Any, float, bool, bool, dict[str, Any]]
PATIENT = 1_000_000


def flying_out(**settings: Any) -> TaskSettings:
    return TaskSettings(factor=COARSE, max_late=PATIENT, fly_out=True, **settings)


def played(
    environment: TableTennisEnvironment, ball: int, *, noise: float = 0.0
) -> tuple[list[Step], int]:
    """All steps of an episode of the scripted policy, and how often the racket met the ball."""
    policy, rng = default_policy(), np.random.default_rng(ball)
    observation, _ = environment.reset(seed=ball, options={"ball": ball})
    steps: list[Step] = []
    while not steps or not (steps[-1][2] or steps[-1][3]):
        action = policy.act(observation) + noise * rng.normal(size=MUSCLES)
        steps.append(environment.step(np.clip(action, -1, 1).astype(np.float32)))
        observation = steps[-1][0]
    return steps, int(environment.task.rows.records[0]["racket"]["count"])


def compared(balls: range, noise: float) -> list[str]:
    """Ends of episodes in which the racket met the ball once, with and without flying out."""
    ends, others = [], 0
    with (
        closing(opened(task=flying_out())) as short,
        closing(opened(task=TaskSettings(factor=COARSE))) as full,
    ):
        for ball in balls:
            once, _ = played(short, ball, noise=noise)
            whole, touches = played(full, ball, noise=noise)
            if touches > 1:  # flying out leaves the second touch out
                others += 1
                continue
            *_, once_info = once[-1]
            _, reward, terminated, truncated, info = whole[-1]
            assert once[-1][1:4] == (reward, terminated, truncated)
            np.testing.assert_equal(once_info, info)
            np.testing.assert_array_equal(once[-1][0][16:], whole[-1][0][16:])  # the ball
            ends.append(info["end_text"])
            if info["touched"]:
                assert len(once) < len(whole)
                assert [step[4]["touched"] for step in once] == [False] * (len(once) - 1) + [True]
                assert whole[len(once) - 1][4]["touched"]
    assert others <= len(ends) / 10
    return ends


def test_reward_info_and_ball_are_those_of_the_whole_flight_bit_for_bit() -> None:
    ends = compared(range(4), 0.0) + compared(range(40, 55), 0.2)
    assert "returned" in ends
    assert len(set(ends)) >= 3


@pytest.mark.parametrize("pacing", ALL_MODES)
def test_it_works_in_every_way_of_pacing_and_replays(pacing: Pacing, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with opened(pacing, task=flying_out(), record=path) as environment:
        steps, _ = played(environment, 3)
        _, reward, terminated, _, info = steps[-1]
        assert terminated
        if not pacing.real_time:  # by the clock a slow machine may miss the ball
            assert info["end"] == End.RETURNED
        assert (1.0 < reward <= 2.0) == (info["end"] == End.RETURNED)
        summary = environment.summary
        landing = info["landing"]
        assert summary.landing == (landing.tolist() if np.isfinite(landing).all() else None)
        # the flight took one more iteration of the twin, and no step
        assert summary.twin_last - summary.twin_first == 5 * len(steps)
        flown = int(info["touched"])
        assert environment.twins[0].published == summary.twin_last + flown

    (episode,) = recorded_episodes(path)
    assert (episode.summary, episode.rewards[-1]) == (summary, reward)
    results = o80.replay(path)
    assert all(result.identical for result in results)


def test_it_is_refused_where_it_cannot_be() -> None:
    with pytest.raises(ValueError, match="give fly_out=False, or worlds=1 instead of 4"):
        TableTennisEnvironment(rig=RigSettings(worlds=4), task=TaskSettings(fly_out=True))
