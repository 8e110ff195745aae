"""Shots of a ball gun without any file."""

from dataclasses import replace

import numpy as np
import pytest
from recorded_rows import simulated_shot

from o80_table_tennis.balls.launches import NARROW, WIDE, Launch, UniformLaunches
from o80_table_tennis.balls.playable import REACH, Verdict, verdict
from o80_table_tennis.balls.simulated_shots import LaunchDistribution, SimulatedShots, drawn_launch
from o80_table_tennis.physics.prediction import predict
from o80_table_tennis.world.arm import SHOULDER
from o80_table_tennis.world.ball import BALL_RADIUS
from o80_table_tennis.world.table import NET_HEIGHT, TABLE

TINY = (0.0, -0.001, 0.001)  # [m]


def test_simulated_shots_bounce_once_and_come_into_reach_like_the_recorded_ones() -> None:
    rng = np.random.default_rng(0)
    for _ in range(30):
        shot = simulated_shot(rng).resample()
        arriving = int(np.argmax(shot.positions[:, 1] < 0.4))

        assert len(shot.bounce_times) == 1
        assert 0.5 < shot.bounce_times[0] < 0.7
        assert 0.65 < arriving * shot.period < 0.9
        assert 0.85 < shot.positions[arriving, 2] < 1.4
        assert len(shot.positions) * shot.period == pytest.approx(1.28, abs=0.01)


def test_a_distribution_without_playable_shots_is_refused() -> None:
    away = UniformLaunches(velocity=(0.0, 5.0, 0.0))
    with pytest.raises(ValueError, match=r"misses the player's half.*choose other means"):
        drawn_launch(np.random.default_rng(0), away)


def found_by_prediction(launch: Launch) -> Verdict:
    """The verdict by a finely predicted flight, row by row."""
    flight = predict(launch.position, launch.velocity, 2.0, spin=launch.spin, period=0.0005)
    after = flight.stamps >= (flight.bounce_times[0] if len(flight.bounce_times) else np.inf)
    at_net = int(np.argmax(flight.positions[:, 1] < TABLE.centre[1]))
    over_net = flight.positions[at_net, 2] > TABLE.top + NET_HEIGHT + BALL_RADIUS
    if after.any() and flight.positions[np.argmax(after), 1] > TABLE.centre[1]:
        return Verdict.NO_BOUNCE
    if not over_net:
        return Verdict.NET
    if not after.any():
        return Verdict.NO_BOUNCE
    near = np.linalg.norm(flight.positions - [0.0, 0.0, SHOULDER], axis=1) < REACH
    first = flight.stamps[np.argmax(after & near)] if (after & near).any() else np.inf
    if (flight.bounce_times[1:] < first).any():
        return Verdict.TWO_BOUNCES
    return Verdict.PLAYABLE if first < np.inf else Verdict.OUT_OF_REACH


def test_the_verdict_is_that_of_the_predicted_flight() -> None:
    rng, seen = np.random.default_rng(3), set()
    for _ in range(150):
        launch = Launch(
            rng.normal(WIDE.position, 0.015),
            rng.normal(WIDE.velocity, (0.5, 0.9, 0.7)),
            rng.normal((64.0, 0.0, 0.0), (60.0, 20.0, 20.0)),
        )
        found = verdict(launch)
        seen.add(found)
        # either may be right where a millimetre decides
        near = [replace(launch, position=launch.position + np.array([0, y, 0])) for y in TINY]
        assert found in map(found_by_prediction, near), launch
    assert seen == set(Verdict)


@pytest.mark.parametrize("distribution", [NARROW, WIDE])
def test_few_draws_are_refused(distribution: LaunchDistribution) -> None:
    rng = np.random.default_rng(1)
    verdicts = [verdict(distribution.draw(rng)) for _ in range(1000)]
    assert verdicts.count(Verdict.PLAYABLE) > 880


def test_wide_shots_fill_their_ranges() -> None:
    shots = SimulatedShots(WIDE)
    launches = [shots.launch(number) for number in range(300)]
    for name, middle, spread in (
        ("position", WIDE.position, WIDE.position_spread),
        ("velocity", WIDE.velocity, WIDE.velocity_spread),
    ):
        away = np.array([getattr(launch, name) for launch in launches]) - middle
        assert np.abs(away).max() <= spread
        assert (np.abs(away).max(axis=0) > 0.9 * spread).all()
    spins = np.array([launch.spin for launch in launches])
    assert spins[:, 0].min() < -55
    assert spins[:, 0].max() > 85
    assert not spins[:, 1:].any()


def test_a_number_brings_a_shot_back_and_each_seed_has_its_own() -> None:
    shots = SimulatedShots(WIDE, seed=5)
    first = shots.launch(2**30)
    shots.launch(3)
    np.testing.assert_array_equal(shots.launch(2**30).velocity, first.velocity)
    for other in (SimulatedShots(WIDE, seed=6), SimulatedShots(NARROW, seed=5)):
        assert not np.array_equal(other.launch(2**30).velocity, first.velocity)
    with pytest.raises(IndexError, match="0 to 3"):
        SimulatedShots(count=4).launch(4)
