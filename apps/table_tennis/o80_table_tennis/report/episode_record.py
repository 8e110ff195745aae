"""A recorded episode: the rows of arm and twin, and how it ended."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class EpisodeSummary:
    """How an episode ended."""

    episode: int
    """Number of the episode, from 0."""
    ball: int
    """Number of the ball in its source; -1 for one given by the user."""
    steps: int
    reward: float
    hit: bool
    """The racket has touched the ball."""
    returned: bool
    """It has, and the ball flew back: v_y > 0 after the touch."""
    end: str
    """Why the episode ended."""
    arm_first: int
    """Iteration of the arm before the first step."""
    arm_last: int
    twin_first: int
    """Iteration of the twin before the first step."""
    twin_last: int


@dataclass(frozen=True, eq=False)
class EpisodeRecord:
    """The rows of arm and twin in one episode, the one before the first step included."""

    summary: EpisodeSummary
    period: float
    """Between two rows [s]."""
    arm_iterations: IntArray
    """(T,)"""
    arm_times: IntArray
    """(T,) [ns], on the arm's clock"""
    arm_lateness: IntArray
    """(T,) of the beginning of the iteration [ns]"""
    pressures_asked: FloatArray
    """(T, 8) raw"""
    pressures: FloatArray
    """(T, 8) raw, in the muscles"""
    joint_positions: FloatArray
    """(T, 4) [rad]"""
    joint_velocities: FloatArray
    """(T, 4) [rad/s]"""
    racket_positions: FloatArray
    """(T, 3), world frame [m]"""
    twin_iterations: IntArray
    """(T,)"""
    twin_joint_positions: FloatArray
    """(T, 4) [rad]"""
    twin_joint_velocities: FloatArray
    """(T, 4) [rad/s]"""
    balls: FloatArray
    """(T, B, 3), world frame [m]; the first one is played"""
    ball_velocities: FloatArray
    """(T, B, 3), world frame [m/s]"""

    @property
    def times(self) -> FloatArray:
        """(T,) since the beginning of the episode [s]."""
        times: FloatArray = (self.arm_iterations - self.arm_iterations[0]) * self.period
        return times

    def save(self, path: Path) -> None:
        """Writes an .npz file with one array a field, and the summary as JSON."""
        arrays: dict[str, Any] = {
            field.name: getattr(self, field.name)
            for field in fields(self)
            if field.name not in ("summary", "period")
        }
        summary = json.dumps({"period": self.period, **asdict(self.summary)})
        np.savez_compressed(path, summary=np.array(summary), **arrays)

    @classmethod
    def load(cls, path: Path) -> EpisodeRecord:
        """Reads a file that `save` wrote."""
        with np.load(path) as file:
            summary = json.loads(str(file["summary"]))
            period = summary.pop("period")
            arrays = {name: file[name] for name in file.files if name != "summary"}
        return cls(summary=EpisodeSummary(**summary), period=period, **arrays)


def load_records(folder: Path) -> list[EpisodeRecord]:
    """All episodes of a folder in the order of their names."""
    return [EpisodeRecord.load(path) for path in sorted(folder.glob("episode_*.npz"))]
