"""The policy that hits: its actions, and what it plays."""

import os
from pathlib import Path

import gymnasium
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

import o80_table_tennis
from o80_table_tennis.balls.sources import balls_from
from o80_table_tennis.environment import TableTennisEnvironment
from o80_table_tennis.players.arm_dynamics import ArmModel
from o80_table_tennis.players.hitting_policy import HittingPolicy, HittingSettings
from o80_table_tennis.players.policies import DEFAULT_FACTOR, default_policy
from o80_table_tennis.playing import play
from o80_table_tennis.settings import RigSettings, TaskSettings
from o80_table_tennis.task.observations import SIZE, ObservationBounds

ROOT = Path(__file__).resolve().parents[3]
DATA = Path(os.environ.get("O80_DATA", ROOT.parent / "shared" / "data"))
PLAYING = np.array([0.17, 1.1, 1.04, 0.5])

Numbers = npt.NDArray[np.float64]
share = st.floats(0.0, 1.0)


def observed(
    ball: list[float], velocity: list[float], pressures: Numbers | None = None
) -> npt.NDArray[np.float32]:
    """The arm at rest where it plays, half of all pressures in its muscles unless given."""
    inside = np.full(8, 0.5) if pressures is None else pressures
    return np.concatenate([PLAYING, np.zeros(4), inside, ball, velocity]).astype(np.float32)


@given(
    shares=st.lists(st.lists(share, min_size=SIZE, max_size=SIZE), min_size=1, max_size=4),
)
def test_every_action_lies_in_the_box(shares: list[list[float]]) -> None:
    bounds, policy = ObservationBounds(), HittingPolicy()
    for row in shares:
        span = bounds.high - bounds.low
        action = policy.act((bounds.low + np.array(row, np.float32) * span).astype(np.float32))
        assert action.shape == (8,)
        assert action.dtype == np.float32
        assert np.all(np.abs(action) <= 1.0)


def test_the_arm_stays_as_it_is_without_a_ball() -> None:
    policy = HittingPolicy()
    pressures = HittingSettings().muscles.pressures(
        ArmModel().torque(PLAYING, np.zeros(4), np.zeros(4)),
        PLAYING,
        HittingSettings().control.mean_pressure,
    )
    row = observed([0.5, -1.0, 0.1], [0.0, 0.0, 0.0], pressures.ravel())
    for _ in range(5):
        assert policy.act(row) == pytest.approx(np.zeros(8), abs=0.01)


def test_a_new_episode_forgets_the_last() -> None:
    coming = observed([0.46, 2.95, 1.37], [0.24, -4.1, 2.3])
    policy = HittingPolicy()
    first = [policy.act(coming) for _ in range(3)]
    policy.reset()
    again = [policy.act(coming) for _ in range(3)]
    assert np.array_equal(first, again)


@pytest.mark.timeout(300)
def test_most_balls_are_hit_and_fly_back() -> None:
    """All recorded shots of the ball gun where they are there, else simulated ones."""
    recorded = DATA / "ball_gun_2019"
    path = str(recorded) if recorded.is_dir() else None
    count = len(balls_from(path)) if path else 20
    environment = gymnasium.make(
        o80_table_tennis.ACCELERATED, task=TaskSettings(balls=path, factor=DEFAULT_FACTOR)
    )
    try:
        played = play(environment, default_policy(), range(count), seed=1)
    finally:
        environment.close()
    assert len(played.episodes) == count
    assert played.returns >= count / 2


@pytest.mark.timeout(300)
@pytest.mark.parametrize("count", [6, pytest.param(80, marks=pytest.mark.check)])
def test_an_arm_with_dead_time_returns_balls_too(count: int) -> None:
    rig = RigSettings(preset="identified")
    policy = default_policy(HittingSettings.of_rig(rig))
    task = TaskSettings(factor=DEFAULT_FACTOR, fly_out=True)
    with TableTennisEnvironment(rig=rig, task=task) as environment:
        played = play(environment, policy, range(count), seed=1)
    assert played.returns >= 0.75 * count
