"""The curves of the comparison: a file for each training, and their median."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..curve import points


@dataclass(frozen=True)
class Point:
    """How a training stood after so many motions."""

    motions: int
    """Motions of the arm."""
    touched: float
    """Share of the fresh shots, with the deterministic policy."""
    returned: float
    reward: float
    """Mean of an episode."""
    transitions: int
    """Kept so far to learn from."""
    gradient_steps: int
    processor_minutes: float


def file_of(folder: Path, way: str, seed: int) -> Path:
    """The curve of a training."""
    return folder / f"{way}-{seed}.csv"


def read(path: Path) -> list[Point]:
    """All points of a training. Raises ValueError for a file of another version."""
    return points(path, Point)


def found(folder: Path, way: str) -> list[list[Point]]:
    """The curves of a way, by seed."""
    return [read(path) for path in sorted(folder.glob(f"{way}-*.csv"))]


def common_motions(curves: Sequence[Sequence[Point]]) -> list[int]:
    """After how many motions every one of the curves has a point."""
    each = [{point.motions for point in curve} for curve in curves]
    return sorted(set.intersection(*each)) if each else []


def column(curves: Sequence[Sequence[Point]], name: str) -> NDArray[np.float64]:
    """(curves, points) of a number, where all have points."""
    motions = common_motions(curves)
    return np.array(
        [[getattr(p, name) for p in curve if p.motions in motions] for curve in curves], np.float64
    ).reshape(len(curves), len(motions))
