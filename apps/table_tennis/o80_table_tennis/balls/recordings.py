"""Reads recorded balls: JSON of a ball gun, HDF5 of shots with known launch parameters."""

from __future__ import annotations

import json
import math
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from o80.base.arrays import FloatArray

from .frame_stamps import FRAME_PERIOD, frames_of, new_frames
from .trajectories import BallTrajectory, require_enough_rows, require_finite


@dataclass(frozen=True)
class Frame:
    """Pose of a file's frame in the world: rotation about z by `yaw`, then shift by `offset`."""

    offset: tuple[float, float, float]
    """[m]"""
    yaw: float = 0.0
    """[rad]"""

    def point(self, rows: FloatArray) -> FloatArray:
        """Transforms positions (N, 3) to the world [m]."""
        shifted: FloatArray = self.direction(rows) + np.array(self.offset)
        return shifted

    def direction(self, rows: FloatArray) -> FloatArray:
        """Transforms velocities (N, 3) to the world."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        turned: FloatArray = rows @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        return turned


BALL_GUN_FRAME = Frame(offset=(-0.4, -0.13, 1.23))
"""Measured frame of the JSON files."""
LAUNCHER_FRAME = Frame(offset=(0.4, 2.95, 0.033), yaw=-math.pi / 2)
"""Frame of the HDF5 files, whose shots begin at the launcher and fly along +x. The height is fitted
to the bounces; all else is chosen: the launcher is at the far end of the table and
shoots at the arm."""

FORMATS = (".json", ".hdf5", ".h5")


def recording_files(path: Path) -> list[Path]:
    """Returns the file itself, or the recordings of a folder, sorted by name."""
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise FileNotFoundError(
            f"{path}: no such file or folder; give a recording ({', '.join(FORMATS)}), "
            "a folder of them, or the name of simulated shots: narrow, wide, launcher"
        )
    files = sorted(file for file in path.iterdir() if file.suffix in FORMATS)
    if not files:
        raise FileNotFoundError(
            f"{path}: no recordings in this folder; expected files ending in {', '.join(FORMATS)}"
        )
    return files


def load_trajectories(path: str | Path) -> list[BallTrajectory]:
    """Reads the trajectories of a file, or of all files of a folder, sorted by name.

    Formats: JSON of a ball gun (`.json`, reconstructed time stamps), HDF5 of shots
    (`.hdf5`, `.h5`).

    Raises FileNotFoundError or ValueError, naming the file and the cure.
    """
    files = recording_files(Path(path))
    return [trajectory for file in files for trajectory in _read(file)]


def _read(file: Path) -> list[BallTrajectory]:
    readers = {".json": _read_ball_gun, ".hdf5": _read_shots, ".h5": _read_shots}
    if file.suffix not in readers:
        raise ValueError(f"{file}: unknown format; can read {', '.join(FORMATS)}")
    return readers[file.suffix](file)


def _read_ball_gun(file: Path) -> list[BallTrajectory]:
    """Reads one shot: {"ob": rows of x, y, z [m], vx, vy, vz [m/s]}, no stamps."""
    every_row = _ball_gun_rows(file)
    numbers = np.flatnonzero(new_frames(every_row[:, :3]))
    rows = every_row[numbers]
    require_finite(f"{file}:", rows)  # time stamps cannot be reconstructed around invalid rows
    require_enough_rows(str(file), len(rows))
    frames = frames_of(rows[:, :3], rows[:, 3:], numbers)
    trajectory = BallTrajectory(
        name=str(file),
        stamps=frames.astype(np.float64) * FRAME_PERIOD,
        positions=BALL_GUN_FRAME.point(rows[:, :3]),
        velocities=BALL_GUN_FRAME.direction(rows[:, 3:]),
    )
    return [replace(trajectory, name=file.stem)]


def _ball_gun_rows(file: Path) -> FloatArray:
    try:
        content = json.loads(file.read_text())
    except ValueError as error:
        raise ValueError(f"{file}: not JSON ({error}); record or download it again") from error
    if not isinstance(content, dict) or "ob" not in content:
        keys = ", ".join(content) if isinstance(content, dict) else type(content).__name__
        raise ValueError(
            f'{file}: no "ob" but {keys}; expected {{"ob": [[x, y, z, vx, vy, vz], ...]}}'
        )
    try:
        rows = np.array(content["ob"], dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(
            f'{file}: the rows of "ob" are not all lists of 6 numbers ({error}); '
            "repair or remove the file"
        ) from error
    if rows.ndim != 2 or rows.shape[1] != 6:
        raise ValueError(
            f'{file}: "ob" has shape {rows.shape}, not (N, 6): x, y, z [m], vx, vy, vz [m/s]'
        )
    return rows


def _read_shots(file: Path) -> list[BallTrajectory]:
    """Reads all shots of an HDF5 file, in order of i.

    originals/<i> has positions (N, 3), velocities (N, 3) and time_stamps (N,)."""
    import h5py

    try:
        content = h5py.File(file, "r")
    except OSError as error:
        raise ValueError(f"{file}: not HDF5 ({error}); record or download it again") from error
    with content:
        if "originals" not in content:
            raise ValueError(
                f'{file}: no group "originals" but {", ".join(content) or "nothing"}; '
                "expected originals/<i>/positions, velocities, time_stamps"
            )
        shots = content["originals"]
        return [_read_shot(file, shots[key]) for key in sorted(shots, key=_number)]


def _read_shot(file: Path, shot: Any) -> BallTrajectory:
    name = f"{file}{shot.name}"
    missing = [key for key in ("positions", "velocities", "time_stamps") if key not in shot]
    if missing:
        raise ValueError(
            f"{name}: no {', '.join(missing)}; there is {', '.join(shot) or 'nothing'}"
        )
    positions, velocities, stamps = (
        np.asarray(shot[key], dtype=np.float64)
        for key in ("positions", "velocities", "time_stamps")
    )
    for key, rows in (("positions", positions), ("velocities", velocities)):
        if rows.ndim != 2 or rows.shape[1] != 3:
            raise ValueError(f"{name}: {key} have shape {rows.shape}, not (N, 3)")
    require_enough_rows(name, len(positions))
    trajectory = BallTrajectory(
        name=name,
        stamps=stamps,
        positions=LAUNCHER_FRAME.point(positions),
        velocities=LAUNCHER_FRAME.direction(velocities),
    )
    return replace(trajectory, name=f"{file.stem}/{shot.name.rsplit('/', 1)[-1]}")


def _number(key: str) -> tuple[int, str]:
    """Sort key: "2" before "10", and names after numbers."""
    return (int(key), "") if key.isdigit() else (sys.maxsize, key)
