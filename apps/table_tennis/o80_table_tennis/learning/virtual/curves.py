"""The curves of the comparison: a file for each training, and their median."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


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


NAMES = [each.name for each in fields(Point)]
_WHOLE = ("motions", "transitions", "gradient_steps")


def file_of(folder: Path, way: str, seed: int) -> Path:
    """The curve of a training."""
    return folder / f"{way}-{seed}.csv"


def append(path: Path, point: Point) -> None:
    """Adds a row; a file that does not exist begins with the names."""
    new = not path.exists()
    with path.open("a", newline="") as file:
        writer = csv.writer(file)
        if new:
            writer.writerow(NAMES)
        writer.writerow(
            f"{value:.6g}" if isinstance(value, float) else value for value in astuple(point)
        )


def read(path: Path) -> list[Point]:
    """All rows. Raises ValueError for a file of another version."""
    with path.open(newline="") as file:
        rows = list(csv.reader(file))
    if not rows or rows[0] != NAMES:
        raise ValueError(f"{path}: not a curve of this version")
    return [
        Point(
            **{  # type: ignore[arg-type]
                name: int(text) if name in _WHOLE else float(text)
                for name, text in zip(NAMES, row, strict=True)
            }
        )
        for row in rows[1:]
    ]


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
