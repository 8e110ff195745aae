"""Recorded trajectories: reading, stamps, the fitted flight; on written files and recorded ones."""

import json
import os
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from o80_table_tennis.balls.flight_fit import bounce_rows, fit_flight
from o80_table_tennis.balls.frame_stamps import FRAME_PERIOD, frames_of
from o80_table_tennis.balls.recordings import BALL_GUN_FRAME, load_trajectories
from o80_table_tennis.balls.simulated_shots import simulated_shot
from o80_table_tennis.balls.trajectories import BallTrajectory
from o80_table_tennis.physics.prediction import predict

ROOT = Path(__file__).resolve().parents[3]
DATA = Path(os.environ.get("O80_DATA", ROOT.parent / "shared" / "data"))


@pytest.fixture(scope="module")
def ball_gun() -> list[BallTrajectory]:
    return load_trajectories(DATA / "ball_gun_2019")


def frames_of_a_reader(rng: np.random.Generator, duration: float) -> np.ndarray:
    """The newest frame every 10 ms: one or two apart."""
    times = 0.010 * np.arange(int(duration / 0.010)) + rng.uniform(0, FRAME_PERIOD)
    frames: np.ndarray = np.floor(times / FRAME_PERIOD).astype(np.int64)
    return frames


def frames_at_random(rng: np.random.Generator, duration: float) -> np.ndarray:
    """One or two apart with equal chance, faster than the usual reader."""
    frames = np.cumsum(rng.integers(1, 3, int(duration / FRAME_PERIOD)))
    return frames[frames * FRAME_PERIOD < duration]


def rows_seen(
    rng: np.random.Generator, frames: np.ndarray, *, noise: float, lag: float
) -> np.ndarray:
    """Rows (N, 6) of a simulated shot at `frames`: noisy positions, late and noisy velocities."""
    shot = simulated_shot(rng).resample(0.0005)
    times = np.arange(len(shot.positions)) * shot.period
    at = (frames - frames[0]) * FRAME_PERIOD

    def sample(values: np.ndarray, when: np.ndarray) -> np.ndarray:
        return np.column_stack([np.interp(when, times, values[:, axis]) for axis in range(3)])

    positions = sample(shot.positions, at) + rng.normal(0, noise, (len(at), 3))
    velocities = sample(shot.velocities, np.maximum(0, at - lag)) + rng.normal(0, 0.1, (len(at), 3))
    return np.hstack([positions, velocities])


def write_ball_gun(path: Path, rows: np.ndarray) -> Path:
    rows = rows.copy()
    rows[:, :3] -= BALL_GUN_FRAME.offset
    path.write_text(json.dumps({"ob": rows.tolist()}))
    return path


def write_shots(path: Path, shots: dict[str, BallTrajectory]) -> Path:
    with h5py.File(path, "w") as file:
        for name, shot in shots.items():
            group = file.create_group(f"originals/{name}")
            group["launch_param"] = np.zeros(5)
            group["positions"], group["velocities"] = shot.positions, shot.velocities
            group["time_stamps"] = shot.stamps
    return path


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    ("frames_read", "lag"), [(frames_of_a_reader, 0.025), (frames_at_random, 0.0)]
)
def test_the_frames_of_rows_without_stamps_are_found(
    seed: int, frames_read: Callable[[np.random.Generator, float], np.ndarray], lag: float
) -> None:
    rng = np.random.default_rng(seed)
    frames = frames_read(rng, 1.25)
    rows = rows_seen(rng, frames, noise=0.001, lag=lag)

    found = frames_of(rows[:, :3], rows[:, 3:], np.arange(len(rows)))

    np.testing.assert_array_equal(found, frames - frames[0])


def test_a_json_file_is_read_into_the_world_with_stamps(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    frames = frames_of_a_reader(rng, 1.25)
    rows = rows_seen(rng, frames, noise=0.001, lag=0.025)
    repeated = np.insert(rows, 40, rows[39], axis=0)

    (shot,) = load_trajectories(write_ball_gun(tmp_path / "shot.json", repeated))

    assert shot.name == "shot"
    np.testing.assert_allclose(shot.positions, rows[:, :3], atol=1e-12)
    np.testing.assert_allclose(shot.stamps, (frames - frames[0]) * FRAME_PERIOD)


def test_the_frame_of_a_file_can_be_given(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    rows = rows_seen(rng, frames_of_a_reader(rng, 1.25), noise=0.0, lag=0.0)
    file = write_ball_gun(tmp_path / "shot.json", rows)

    (usual,) = load_trajectories(file)
    (moved,) = load_trajectories(file, frame_offset=(1.0, 2.0, 3.0), frame_yaw=np.pi / 2)

    raw = usual.positions - BALL_GUN_FRAME.offset
    turned = np.column_stack([-raw[:, 1], raw[:, 0], raw[:, 2]])
    expected = turned + np.array([1.0, 2.0, 3.0])
    np.testing.assert_allclose(moved.positions, expected, atol=1e-12)
    np.testing.assert_allclose(moved.velocities[:, 0], -usual.velocities[:, 1], atol=1e-12)
    with pytest.raises(ValueError, match="three numbers"):
        load_trajectories(file, frame_offset=(1.0, 2.0))


def test_the_shots_of_an_hdf5_file_come_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    shots = {str(i): simulated_shot(np.random.default_rng(i)) for i in (10, 2, 1)}
    file = write_shots(tmp_path / "shots.hdf5", shots)

    read = load_trajectories(file, frame_offset=(0.0, 0.0, 0.0), frame_yaw=0.0)

    assert [shot.name for shot in read] == ["shots/1", "shots/2", "shots/10"]
    np.testing.assert_array_equal(read[2].positions, shots["10"].positions)
    np.testing.assert_array_equal(read[2].velocities, shots["10"].velocities)
    np.testing.assert_array_equal(read[2].stamps, shots["10"].stamps)


def test_a_folder_gives_all_its_files_in_order(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    rows = rows_seen(rng, frames_of_a_reader(rng, 1.25), noise=0.001, lag=0.025)
    for name in ("b", "a"):
        write_ball_gun(tmp_path / f"{name}.json", rows)
    write_shots(tmp_path / "c.hdf5", {"0": simulated_shot(rng)})
    (tmp_path / "LICENSE").write_text("text")

    assert [shot.name for shot in load_trajectories(tmp_path)] == ["a", "b", "c/0"]


GOOD_ROW = [0.0, 0.0, 0.0, 0.0, -4.0, 1.0]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "not JSON"),
        ("[1, 2]", '"ob"'),
        ('{"balls": []}', "balls"),
        ('{"ob": []}', "shape"),
        ('{"ob": [[1, 2, 3]]}', r"\(1, 3\)"),
        ('{"ob": [[1, 2, 3], [1]]}', "6 numbers"),
        ('{"ob": [["x", 2, 3, 4, 5, 6]]}', "6 numbers"),
        (json.dumps({"ob": [GOOD_ROW] * 50}), "too few"),
        (json.dumps({"ob": [[i, *GOOD_ROW[1:]] for i in range(5)]}), "too few"),
        (json.dumps({"ob": [[i, *GOOD_ROW[1:5], float("nan")] for i in range(50)]}), "NaN"),
    ],
)
def test_a_bad_json_file_is_named_with_what_is_wrong(
    tmp_path: Path, content: str, message: str
) -> None:
    file = tmp_path / "bad.json"
    file.write_text(content)

    with pytest.raises(ValueError, match=message) as raised:
        load_trajectories(file)
    assert str(file) in str(raised.value)


def test_a_bad_hdf5_file_is_named_with_what_is_wrong(tmp_path: Path) -> None:
    text = tmp_path / "text.hdf5"
    text.write_text("no")
    with pytest.raises(ValueError, match=r"text\.hdf5: not HDF5"):
        load_trajectories(text)

    empty = tmp_path / "empty.h5"
    h5py.File(empty, "w").close()
    with pytest.raises(ValueError, match=r'empty\.h5: no group "originals"'):
        load_trajectories(empty)

    partial = tmp_path / "partial.h5"
    with h5py.File(partial, "w") as file:
        file["originals/0/positions"] = np.zeros((20, 3))
    with pytest.raises(ValueError, match=r"partial\.h5/originals/0: no velocities, time_stamps"):
        load_trajectories(partial)

    odd = tmp_path / "odd.h5"
    with h5py.File(odd, "w") as file:
        for key, rows in (("positions", (20, 2)), ("velocities", (20, 3)), ("time_stamps", (20,))):
            file[f"originals/0/{key}"] = np.zeros(rows)
    with pytest.raises(ValueError, match=r"odd\.h5/originals/0: positions have shape \(20, 2\)"):
        load_trajectories(odd)


def test_a_missing_path_an_empty_folder_and_a_foreign_file_are_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="nowhere"):
        load_trajectories(tmp_path / "nowhere")
    with pytest.raises(FileNotFoundError, match="no recordings"):
        load_trajectories(tmp_path)
    (tmp_path / "balls.csv").write_text("")
    with pytest.raises(ValueError, match="unknown format"):
        load_trajectories(tmp_path / "balls.csv")


def test_a_trajectory_whose_arrays_do_not_fit_is_refused() -> None:
    stamps, rows = np.linspace(0.0, 0.1, 20), np.zeros((20, 3))
    broken = rows.copy()
    broken[3, 1] = np.nan
    for arguments, message in (
        ((stamps[:19], rows, rows), "positions have shape"),
        ((stamps, rows, broken), r"velocities hold NaN.*row 3"),
        ((stamps[::-1], rows, rows), "do not rise from row 0"),
    ):
        with pytest.raises(ValueError, match=message) as raised:
            BallTrajectory("shot 7", *arguments)
        assert "shot 7" in str(raised.value)


def test_a_trajectory_too_short_to_fit_is_refused_when_sampled() -> None:
    short = BallTrajectory("shot 7", np.arange(4.0), np.zeros((4, 3)), np.zeros((4, 3)))

    with pytest.raises(ValueError, match="shot 7: 4 rows are too few"):
        short.resample()


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


def test_the_sampled_flight_is_smooth_except_for_its_bounce() -> None:
    shot = simulated_shot(np.random.default_rng(2))
    sampled = shot.resample(0.002)

    # each step is the mean of its two velocities, but for the one that holds the bounce
    steps = np.diff(sampled.positions, axis=0) / sampled.period
    means = (sampled.velocities[1:] + sampled.velocities[:-1]) / 2
    off = np.linalg.norm(steps - means, axis=1)
    bounce = int(sampled.bounce_times[0] / sampled.period)
    assert np.delete(off, bounce).max() < 1e-3
    # no jump of the position at the bounce
    assert off[bounce] * sampled.period < 0.02
    assert sampled.positions[:, 2].min() == pytest.approx(0.795, abs=0.008)
    assert sampled.residual < 0.001
    assert len(sampled.positions) == len(sampled.velocities)
    assert sampled.duration == pytest.approx(shot.duration, abs=0.002)


@pytest.mark.parametrize("period", [0.0, -0.002, float("nan")])
def test_a_period_that_is_none_is_refused(period: float) -> None:
    with pytest.raises(ValueError, match="period"):
        simulated_shot(np.random.default_rng(2)).resample(period)


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
    assert shot.stamps[lowest - 2] <= sampled.duration + 0.002 <= shot.stamps[lowest] + 0.004
    assert sampled.residual < 0.001


@pytest.mark.recordings("ball_gun_2019")
def test_the_ball_gun_flights_are_those_that_were_measured(ball_gun: list[BallTrajectory]) -> None:
    flights = [shot.resample() for shot in ball_gun]
    fits = [shot.fit for shot in ball_gun]

    assert len(ball_gun) == 80
    assert np.mean([shot.duration for shot in ball_gun]) == pytest.approx(1.28, abs=0.01)
    assert max(flight.residual for flight in flights) < 0.005
    assert all(len(fit.bounce_times) == 1 for fit in fits)

    # drag of a plain ball, under full gravity: the time scale is right
    drags = np.array([fit.flights[0].drag_coefficient for fit in fits])
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


@pytest.mark.recordings("ball_gun_2019")
def test_most_rows_of_the_ball_gun_are_one_or_two_frames_apart(
    ball_gun: list[BallTrajectory],
) -> None:
    for shot in ball_gun:
        frames = np.rint(shot.stamps / FRAME_PERIOD)
        np.testing.assert_allclose(shot.stamps, frames * FRAME_PERIOD)
        assert np.mean(np.isin(np.diff(frames), (1, 2))) > 0.9, shot.name


@pytest.mark.recordings("ball_gun_2019")
def test_fitted_velocities_change_as_gravity_and_air_would_have_it(
    ball_gun: list[BallTrajectory],
) -> None:
    for shot in ball_gun[:5]:
        times = np.arange(shot.fit.start, shot.fit.bounce_times[0] - 0.05, 0.01)
        _, fitted = shot.fit.at(times)
        # gravity, and at most 3 m/s^2 of drag and spin
        assert np.all(np.abs(np.diff(fitted[:, 2]) / 0.01 + 9.81) < 3)


@pytest.mark.recordings("spin_2022")
@pytest.mark.parametrize(("name", "turn"), [("mn5008_topspin", 0.35), ("mn5008_no_spin", 0.18)])
def test_the_shots_of_the_launcher_show_their_spin(name: str, turn: float) -> None:
    shots = load_trajectories(DATA / "spin_2022" / f"{name}.hdf5")

    flights = [shot.resample() for shot in shots]
    turns = [shot.fit.flights[0].turn[0] for shot in shots]

    assert np.median(turns) == pytest.approx(turn, abs=0.04)
    assert np.median([flight.residual for flight in flights]) < 0.004
    assert all(flight.positions[0, 1] > flight.positions[-1, 1] for flight in flights)
