"""The learning curve: a row of means before each update; its file and its picture."""

import csv
import os
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

import numpy as np

from o80.base.arrays import FloatArray
from o80.base.errors import InvalidArgument
from o80.base.extras import needed
from o80.learning.rollouts.rollout import Ends

LAST = 1000
"""Number of last episodes in the means."""
CURVE = "curve.csv"
"""The file in the folder of a training."""
ALONG = {
    "decisions": "decisions",
    "play_hours": "play, without resets [h]",
    "minutes": "time [min]",
}
Point = TypeVar("Point")


@dataclass(frozen=True)
class CurvePoint:
    """State of the training before an update. Means are over the last 1000 episodes."""

    decisions: int
    """Decisions of all copies."""
    episodes: int
    play_hours: float
    """Clock time of collecting rollouts, without `reset_hours` [h]."""
    reset_hours: float
    """Clock time of resets [h]; 0 with several copies, which reset within their steps."""
    minutes: float
    """Clock time of the whole training [min]."""
    success: float
    """Share of successes, with the noise of exploration; NaN if the info does not report it."""
    reward: float
    """Mean sum of rewards over an episode."""
    length: float
    """Mean number of steps of an episode."""
    exploration: float
    """Mean standard deviation of the actions in [-1, 1]."""


class EpisodeWindow:
    """Success, reward and length of the last episodes; a checkpoint stores the window."""

    def __init__(self, episodes: int = 0, rows: FloatArray | None = None) -> None:
        """episodes, rows: of a saved window."""
        self.episodes = episodes
        """Number of episodes that ended so far."""
        self.rows: FloatArray = np.zeros((0, 3)) if rows is None else rows
        """(n, 3) success (NaN: not in the info), sum of rewards, and steps of each of the last
        episodes; at most `LAST`."""

    def add(self, ends: Ends, success: str) -> None:
        """Adds the episodes of a rollout; success: the entry of the info with success."""
        successes = ends.infos[success].astype(np.float64)  # NaN for None
        rows = np.column_stack([successes, ends.rewards, ends.lengths])
        self.episodes += len(rows)
        self.rows = np.concatenate([self.rows, rows])[-LAST:]

    def means(self) -> tuple[float, float, float]:
        """Returns share of successes, mean reward and mean length; NaN without an episode."""
        if not len(self.rows):
            return np.nan, np.nan, np.nan
        success, (_, reward, length) = success_share(self.rows[:, 0]), self.rows.mean(axis=0)
        return success, float(reward), float(length)


def success_share(successes: FloatArray) -> float:
    """Returns the share of (n,) successes; NaN if all are unknown. If only some are unknown, they
    count as failures, because some tasks report only successes.
    """
    known = not np.isnan(successes).all()
    return float(np.nan_to_num(successes).mean()) if known else np.nan


def names_of(kind: type[Any]) -> list[str]:
    """Returns the names of the numeric fields of a dataclass of points."""
    return [each.name for each in fields(kind)]


def append(path: Path, point: Any) -> None:
    """Appends a row to a file; writes the names first if the file is new."""
    new = not path.exists()
    with path.open("a", newline="") as file:
        writer = csv.writer(file)
        if new:
            writer.writerow(names_of(type(point)))
        writer.writerow(
            f"{value:.6g}" if isinstance(value, float) else value for value in astuple(point)
        )


def points(path: Path, kind: type[Point]) -> list[Point]:
    """Reads all rows of a file of points, except one that a kill has truncated.

    Raises InvalidArgument for a file of another version.
    """
    with path.open(newline="") as file:
        rows = list(csv.reader(file))
    if not rows or rows[0] != names_of(kind):
        raise InvalidArgument(f"{path}: not a learning curve of this version")
    types = get_type_hints(kind)
    return [
        kind(**{name: types[name](text) for name, text in zip(rows[0], row, strict=True)})
        for row in rows[1:]
        if len(row) == len(rows[0])
    ]


def cut(path: Path, kind: type[Any], decisions: int) -> None:
    """Drops the rows after this number of decisions, where a training resumes."""
    if not path.exists():
        return  # the training was stopped before its first update
    kept = [point for point in points(path, kind) if point.decisions <= decisions]
    new = path.with_name(f"{path.name}.new")
    new.unlink(missing_ok=True)
    for point in kept:
        append(new, point)
    if kept:
        os.replace(new, path)
    else:
        path.unlink()


def draw(path: Path, curves: Mapping[str, Sequence[CurvePoint]]) -> None:
    """Draws success and reward of trainings by name. Needs the extra `plot`."""
    needed("matplotlib", "plot", "the picture of a learning curve")
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 8), layout="constrained")
    grid = figure.subplots(2, len(ALONG), sharey="row", sharex="col")
    for axes_row, shown in zip(grid, ("success", "reward"), strict=True):
        for axes, along in zip(axes_row, ALONG, strict=True):
            for name, curve in curves.items():
                x, y = ([getattr(point, each) for point in curve] for each in (along, shown))
                axes.plot(x, y, label=name)
            axes.grid(alpha=0.3)
        axes_row[0].set_ylabel(f"{shown} of the last {LAST} episodes")
    for axes, label in zip(grid[1], ALONG.values(), strict=True):
        axes.set_xlabel(label)
    grid[0][0].set_ylim(0, 1)
    grid[0][0].legend(fontsize=8)
    figure.savefig(path, dpi=110)
