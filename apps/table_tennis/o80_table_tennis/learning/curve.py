"""The learning curve: a row for each update of the policy, in a file of comma-separated values."""

from __future__ import annotations

import csv
from dataclasses import astuple, dataclass, fields
from pathlib import Path

CURVE = "curve.csv"
"""The file in the folder of a training."""
NOT_EVALUATED = float("nan")


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


NAMES = [each.name for each in fields(CurvePoint)]
_WHOLE = ("decisions", "episodes", "motions", "restarts")


def append(path: Path, point: CurvePoint) -> None:
    """Adds a row; a file that does not exist begins with the names."""
    new = not path.exists()
    with path.open("a", newline="") as file:
        writer = csv.writer(file)
        if new:
            writer.writerow(NAMES)
        writer.writerow(
            f"{value:.6g}" if isinstance(value, float) else value for value in astuple(point)
        )


def read(path: Path) -> list[CurvePoint]:
    """All rows. Raises ValueError for a file of another version."""
    with path.open(newline="") as file:
        rows = list(csv.reader(file))
    if not rows or rows[0] != NAMES:
        raise ValueError(f"{path}: not a learning curve of this version")
    return [
        CurvePoint(
            **{  # type: ignore[arg-type]
                name: int(text) if name in _WHOLE else float(text)
                for name, text in zip(NAMES, row, strict=True)
            }
        )
        for row in rows[1:]
    ]


def cut(path: Path, decisions: int) -> None:
    """Drops the rows after so many decisions: a training resumes there."""
    if not path.exists():
        return  # it was stopped before its first update
    points = [point for point in read(path) if point.decisions <= decisions]
    path.unlink()
    for point in points:
        append(path, point)
