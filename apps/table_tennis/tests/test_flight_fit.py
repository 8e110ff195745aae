"""The fitted flight: of simulated rows, and of recorded ones."""

import numpy as np
import pytest
from recorded_rows import DATA, ball_gun_shots, simulated_shot

from o80_table_tennis.balls.flight_fit import bounce_rows, fit_flight
from o80_table_tennis.balls.frame_stamps import FRAME_PERIOD
from o80_table_tennis.balls.recordings import load_trajectories
from o80_table_tennis.balls.trajectories import BallTrajectory
from o80_table_tennis.physics.aerodynamics import AERODYNAMICS
from o80_table_tennis.physics.prediction import predict


def test_a_fit_finds_the_flight_behind_noise() -> None:
    rng = np.random.default_rng(5)
    shot = simulated_shot(rng)
    noisy = shot.positions + rng.normal(0, 0.003, shot.positions.shape)

    fit = fit_flight(shot.stamps, noisy)
    positions, velocities = fit.at(shot.stamps)

    away_from_bounce = np.abs(shot.stamps - fit.bounce_times[0]) > 0.006
    assert np.sqrt(np.mean((positions - shot.positions) ** 2)) < 0.001
    off = np.linalg.norm(velocities - shot.velocities, axis=1)[away_from_bounce]
    assert np.median(off) < 0.03
    assert off.max() < 0.15


def test_a_row_far_off_changes_little() -> None:
    shot = simulated_shot(np.random.default_rng(1))
    spoiled = shot.positions.copy()
    spoiled[30] += (0.1, -0.1, -0.15)

    fit = fit_flight(shot.stamps, spoiled)

    assert len(fit.bounce_times) == 1
    positions, _ = fit.at(shot.stamps)
    assert np.abs(positions - shot.positions).max() < 0.006


@pytest.mark.parametrize(("duration", "bounces"), [(0.5, 0), (1.2, 1), (1.9, 2)])
def test_every_bounce_is_found(duration: float, bounces: int) -> None:
    start, velocity = (0.4, 2.5, 1.37), (0.0, -1.2, 2.28)
    flight = predict(start, velocity, duration, period=FRAME_PERIOD)

    found, _ = bounce_rows(flight.positions)
    seen = BallTrajectory("seen", flight.stamps, flight.positions, flight.velocities)
    sampled = seen.resample()

    assert len(found) == bounces
    assert len(sampled.bounce_times) == bounces
    assert sampled.residual < 0.001


@pytest.mark.parametrize("rows_after", [1, 2, 3])
def test_rows_of_a_bounce_too_short_to_be_seen_are_left_out(rows_after: int) -> None:
    shot = simulated_shot(np.random.default_rng(4))
    lowest = bounce_rows(shot.positions)[0][0]
    cut = slice(0, lowest + 1 + rows_after)
    short = BallTrajectory("cut", shot.stamps[cut], shot.positions[cut], shot.velocities[cut])

    sampled = short.resample()

    assert len(sampled.bounce_times) == 0
    duration = len(sampled.positions) * sampled.period
    assert shot.stamps[lowest - 2] <= duration <= shot.stamps[lowest] + 0.004
    # the lowest row may lie a little behind the bounce, and off the flight
    assert sampled.residual < 0.0025


@pytest.mark.recordings("ball_gun_2019")
def test_the_ball_gun_flights_are_those_that_were_measured() -> None:
    fits = [shot.fit for shot in ball_gun_shots()]

    assert len(ball_gun_shots()) == 80
    durations = [np.ptp(shot.stamps) for shot in ball_gun_shots()]
    assert np.mean(durations) == pytest.approx(1.28, abs=0.01)
    assert max(np.sqrt(np.mean(fit.residuals**2)) for fit in fits) < 0.005
    assert all(len(fit.bounce_times) == 1 for fit in fits)

    # drag of a plain ball, under full gravity: the time scale is right
    drags = np.array([fit.flights[0].unknowns[6] for fit in fits])
    drags /= AERODYNAMICS.drag_per_coefficient
    assert 0.34 < np.median(drags) < 0.44
    assert drags.std() < 0.03

    heights, normal, tangential = [], [], []
    for fit in fits:
        position, before = (values[0] for values in fit.flights[0].at(fit.bounce_times))
        after = fit.flights[1].at(fit.bounce_times)[1][0]
        heights.append(position[2])
        normal.append(-after[2] / before[2])
        tangential.append(np.hypot(*after[:2]) / np.hypot(*before[:2]))
    assert np.median(heights) == pytest.approx(0.795, abs=0.005)
    assert np.median(normal) == pytest.approx(0.92, abs=0.02)
    assert np.median(tangential) == pytest.approx(0.69, abs=0.04)


@pytest.mark.recordings("spin_2022")
@pytest.mark.parametrize(("name", "turn"), [("mn5008_topspin", 0.35), ("mn5008_no_spin", 0.18)])
def test_the_shots_of_the_launcher_show_their_spin(name: str, turn: float) -> None:
    shots = load_trajectories(DATA / "spin_2022" / f"{name}.hdf5")

    errors = [np.sqrt(np.mean(shot.fit.residuals**2)) for shot in shots]
    turns = [shot.fit.flights[0].turn[0] for shot in shots]

    assert np.median(turns) == pytest.approx(turn, abs=0.04)
    assert np.median(errors) < 0.004
    assert all(shot.positions[0, 1] > shot.positions[-1, 1] for shot in shots)
