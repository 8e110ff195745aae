"""Simulated rows of the vision system, files with them, and recorded rows."""

import json
import os
from functools import cache
from pathlib import Path

import h5py
import numpy as np

from o80_table_tennis.balls.frame_stamps import FRAME_PERIOD
from o80_table_tennis.balls.recordings import BALL_GUN_FRAME, load_trajectories
from o80_table_tennis.balls.simulated_shots import drawn_launch
from o80_table_tennis.balls.trajectories import BallTrajectory
from o80_table_tennis.physics.prediction import Numbers, predict

ROOT = Path(__file__).resolve().parents[3]
DATA = Path(os.environ.get("O80_DATA", ROOT.parent / "shared" / "data"))


@cache
def ball_gun_shots() -> list[BallTrajectory]:
    """Loads all recorded shots of the ball gun, and fits them once."""
    return load_trajectories(DATA / "ball_gun_2019")


def simulated_shot(rng: np.random.Generator) -> BallTrajectory:
    """Draws a shot, as seen by cameras."""
    return drawn_launch(rng).seen()


def crossing(
    position: Numbers, velocity: Numbers, *, axis: int, at: float, spin: Numbers
) -> tuple[float, np.ndarray, np.ndarray]:
    """Computes time, position and velocity of a ball's first crossing of a plane."""
    flight = predict(position, velocity, 2.0, spin=spin, period=0.0005)
    rows = np.column_stack([flight.stamps, flight.positions, flight.velocities])
    off = rows[:, 1 + axis] - at
    row = int(np.argmax(off[:-1] * off[1:] <= 0.0))
    found = rows[row] + off[row] / (off[row] - off[row + 1]) * (rows[row + 1] - rows[row])
    return float(found[0]), found[1:4], found[4:]


def frames_of_a_reader(rng: np.random.Generator, duration: float) -> np.ndarray:
    """Returns the newest frame every 10 ms: frames are one or two apart."""
    times = 0.010 * np.arange(int(duration / 0.010)) + rng.uniform(0, FRAME_PERIOD)
    frames: np.ndarray = np.floor(times / FRAME_PERIOD).astype(np.int64)
    return frames


def frames_at_random(rng: np.random.Generator, duration: float) -> np.ndarray:
    """Returns frames one or two apart with equal probability, faster than the usual reader."""
    frames = np.cumsum(rng.integers(1, 3, int(duration / FRAME_PERIOD)))
    return frames[frames * FRAME_PERIOD < duration]


def rows_seen(
    rng: np.random.Generator, frames: np.ndarray, *, noise: float, lag: float
) -> np.ndarray:
    """Simulates rows (N, 6) of a shot at `frames`: noisy positions, late and noisy velocities."""
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
