"""A recorded flight is replayed by the law of the simulator: nothing jumps at the hand-over."""

from itertools import pairwise

import numpy as np
import pytest
from recorded_rows import DATA, ball_gun_shots

from o80_mujoco.balls import accelerations
from o80_table_tennis.balls.recordings import load_trajectories
from o80_table_tennis.balls.sampled_flight import SampledFlight
from o80_table_tennis.balls.simulated_shots import SimulatedShots
from o80_table_tennis.balls.trajectories import BallTrajectory
from o80_table_tennis.physics.aerodynamics import AERODYNAMICS
from o80_table_tennis.physics.prediction import predict

SPIN_SETS = ("mn5008_no_spin.hdf5", "mn5008_topspin.hdf5")


def assert_nothing_jumps(flight: SampledFlight) -> None:
    """Wherever the simulator takes over, the ball flies on as it would have been replayed."""
    times = np.arange(len(flight.states)) * flight.period
    edges = [0.0, *flight.bounce_times, np.inf]
    for begin, end in pairwise(edges):
        rows = np.flatnonzero((times > begin) & (times < end))
        for row in rows[:-5:20]:
            state = flight.states[row]
            rest = times[rows[-1]] - times[row]
            on = predict(
                state[:3], state[3:6], rest, spin=state[6:], period=flight.period, table=None
            )
            np.testing.assert_allclose(
                on.positions, flight.positions[row : rows[-1] + 1], rtol=0, atol=2e-5
            )
            np.testing.assert_allclose(
                on.velocities, flight.velocities[row : rows[-1] + 1], rtol=0, atol=2e-4
            )
        # the replayed velocities change as the simulator changes them
        changes = (flight.velocities[rows[2:]] - flight.velocities[rows[:-2]]) / (2 * flight.period)
        expected = accelerations(flight.states[rows[1:-1]], AERODYNAMICS.air)
        np.testing.assert_allclose(changes, expected, rtol=0, atol=0.02)


@pytest.mark.recordings("ball_gun_2019")
def test_nothing_jumps_where_a_shot_of_the_ball_gun_is_handed_over() -> None:
    for shot in ball_gun_shots()[::4]:
        assert_nothing_jumps(shot.resample())


@pytest.mark.recordings("spin_2022")
@pytest.mark.parametrize("name", SPIN_SETS)
def test_nothing_jumps_where_a_shot_with_spin_is_handed_over(name: str) -> None:
    for shot in load_trajectories(DATA / "spin_2022" / name)[:8]:
        assert_nothing_jumps(shot.resample())


@pytest.mark.recordings("ball_gun_2019")
def test_a_replayed_flight_is_near_its_rows() -> None:
    shots = ball_gun_shots()
    errors = np.array([np.sqrt(np.mean(shot.replayed.residuals**2)) for shot in shots])
    assert np.sqrt(np.mean(errors**2)) < 0.004
    assert errors.max() < 0.006
    # with a drag of each flight, which the simulator has not: 0.0028 m


@pytest.mark.recordings("spin_2022")
@pytest.mark.parametrize(("name", "before", "after"), [(SPIN_SETS[0], 3, 3), (SPIN_SETS[1], 15, 4)])
def test_a_replayed_shot_with_spin_is_near_its_rows(name: str, before: float, after: float) -> None:
    """Shots with top spin have more drag before the bounce than the simulator knows."""
    missed: list[list[float]] = [[], []]  # [mm]
    for shot in load_trajectories(DATA / "spin_2022" / name):
        inside = (shot.stamps >= shot.fit.start) & (shot.stamps <= shot.fit.end)
        flights = np.searchsorted(shot.fit.bounce_times, shot.stamps[inside], side="right")
        for number in set(flights[flights < 2].tolist()):
            residuals = shot.replayed.residuals[flights == number]
            missed[number].append(1e3 * float(np.sqrt(np.mean(residuals**2))))
    assert np.median(missed[0]) < before
    assert np.median(missed[1]) < after


def test_the_spin_of_a_simulated_shot_is_found() -> None:
    for number in range(8):
        launch = SimulatedShots().launch(number)
        seen = launch.seen()
        bare = BallTrajectory(seen.name, seen.stamps, seen.positions, seen.velocities)
        first = bare.replayed.flights[0]
        np.testing.assert_allclose(first.state[:3], launch.position, atol=1e-3)
        np.testing.assert_allclose(first.state[3:], launch.velocity, atol=0.02)
        np.testing.assert_allclose(first.spin, launch.spin, atol=8)
        assert bare.resample().residual < 5e-4
