"""Recorded shots of the launcher, from HDF5 files: needs the extra `recordings`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.base.extras import needed
from o80.errors import InvalidArgument

FORMATS = (".hdf5", ".h5")
FEWEST_ROWS = 20


@dataclass(frozen=True)
class Setting:
    """Setting of the launcher before a shot."""

    phi: float
    theta: float
    speeds: tuple[float, float, float]
    """Speeds of the motors top left, top right, bottom [1/min]."""


@dataclass(frozen=True, eq=False)
class Shot:
    """A ball seen by cameras after its launch, in the frame of the launcher."""

    name: str
    setting: Setting
    stamps: NDArray[np.float64]
    """(N,) time since the first row [s]; the time of the launch is not recorded."""
    positions: NDArray[np.float64]
    """(N, 3) [m]"""


def recorded_shots(paths: Sequence[Path]) -> list[Shot]:
    """Reads the shots of files, and of all files in folders, sorted by name.

    A file has groups originals/<i>/{launch_param (5,), positions (N, 3), time_stamps (N,)}; the
    launch parameters are phi, theta and the three motor speeds. Raises InvalidArgument if a
    file cannot be read or no shot is found, o80.MissingExtra without h5py.
    """
    h5py = needed("h5py", "recordings", "reading recorded shots", package="o80-devices")
    shots = [shot for path in paths for file in _files(path) for shot in _read(h5py, file)]
    if not shots:
        raise InvalidArgument("no shots: name files that end in .hdf5 or .h5, or a folder of them")
    return shots


def _files(path: Path) -> list[Path]:
    if not path.exists():
        raise InvalidArgument(f"{path}: no such file or folder")
    if path.is_dir():
        return sorted(file for file in path.iterdir() if file.suffix in FORMATS)
    return [path]


def _read(h5py: Any, file: Path) -> list[Shot]:
    try:
        with h5py.File(file, "r") as content:
            groups = content["originals"]
            return [_shot(f"{file.stem}/{key}", groups[key]) for key in sorted(groups, key=int)]
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise InvalidArgument(
            f"{file} cannot be read: {error}; expected HDF5 with "
            "originals/<i>/{launch_param, positions, time_stamps}"
        ) from error


def _shot(name: str, group: Any) -> Shot:
    phi, theta, *speeds = (float(value) for value in group["launch_param"])
    left, right, bottom = speeds
    stamps = np.asarray(group["time_stamps"], dtype=np.float64)
    positions = np.asarray(group["positions"], dtype=np.float64)
    if positions.shape != (len(stamps), 3) or len(stamps) < FEWEST_ROWS:
        raise ValueError(
            f"{name} has positions of the shape {positions.shape} and {len(stamps)} time stamps; "
            f"expected (N, 3) and N, at least {FEWEST_ROWS}"
        )
    return Shot(name, Setting(phi, theta, (left, right, bottom)), stamps - stamps[0], positions)
