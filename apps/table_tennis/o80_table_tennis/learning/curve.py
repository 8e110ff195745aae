"""The learning curve: a row for each update of the policy, in a file of comma-separated values."""

from __future__ import annotations

import csv
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

CURVE = "curve.csv"
"""The file in the folder of a training."""
NOT_EVALUATED = float("nan")
Point = TypeVar("Point")


@dataclass(frozen=True)
class CurvePoint:
    """How the training stood after an update. Shares are those of the last 1000 episodes."""

    decisions: int
    episodes: int
    motions: int
    """Motions of the arm so far: one an episode, with a ball of its own."""
    minutes: float
    """Since the start, on the clock [min]."""
    processor_minutes: float
    touched: float
    """Share of the balls that the racket touched, with the noise of exploration."""
    returned: float
    reward: float
    """Mean sum over an episode."""
    exploration: float
    """Mean standard deviation of the actions."""
    restarts: int
    """Networks that were replaced by new ones, because they had got stuck."""
    environment: float
    """Share of the processor time that the environments took, without evaluations."""
    evaluated_touched: float = NOT_EVALUATED
    """The same without exploration, on balls of their own; not in every row."""
    evaluated_returned: float = NOT_EVALUATED
    evaluated_reward: float = NOT_EVALUATED

    @property
    def evaluated(self) -> bool:
        """Whether the deterministic policy was evaluated here."""
        return self.evaluated_returned == self.evaluated_returned  # false for NaN


def names_of(kind: type[Any]) -> list[str]:
    """Names of the numbers of a kind of points, a dataclass."""
    return [each.name for each in fields(kind)]


def append(path: Path, point: Any) -> None:
    """Adds a row; a file that does not exist begins with the names."""
    new = not path.exists()
    with path.open("a", newline="") as file:
        writer = csv.writer(file)
        if new:
            writer.writerow(names_of(type(point)))
        writer.writerow(
            f"{value:.6g}" if isinstance(value, float) else value for value in astuple(point)
        )


def read(path: Path) -> list[CurvePoint]:
    """All points of a training. Raises ValueError for a file of another version."""
    return points(path, CurvePoint)


def points(path: Path, kind: type[Point]) -> list[Point]:
    """All rows of a file of such points. Raises ValueError for a file of another version."""
    with path.open(newline="") as file:
        rows = list(csv.reader(file))
    if not rows or rows[0] != names_of(kind):
        raise ValueError(f"{path}: not a learning curve of this version")
    types = get_type_hints(kind)
    return [
        kind(**{name: types[name](text) for name, text in zip(rows[0], row, strict=True)})
        for row in rows[1:]
    ]


def cut(path: Path, decisions: int) -> None:
    """Drops the rows after so many decisions: a training resumes there."""
    if not path.exists():
        return  # it was stopped before its first update
    kept = [point for point in read(path) if point.decisions <= decisions]
    path.unlink()
    for point in kept:
        append(path, point)
