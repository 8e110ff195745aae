"""The picture of learning curves: touched, returned and reward, beside the baselines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .curve import CurvePoint
from .episodes import Shares

RESOLUTION = 110
"""[dots per inch]"""
AXES = (
    ("decisions", "decisions"),
    ("episodes", "episodes, each a motion of the arm"),
    ("processor_minutes", "processor time [min]"),
)
FEWEST = 200
"""Shares of fewer episodes are not drawn: they say nothing yet."""
STYLES = ("--", ":", "-.", (0, (1, 3)))


def plot_curves(
    path: Path,
    curves: Mapping[str, Sequence[CurvePoint]],
    *,
    baselines: Mapping[str, Shares],
    title: str,
) -> None:
    """One colour for each training; thin: with exploration, thick: the deterministic policy."""
    figure = Figure(figsize=(13, 8.5), layout="constrained")
    figure.suptitle(title)
    grid = figure.subplots(3, len(AXES), sharey="row", sharex="col")
    for row, name in enumerate(("touched", "returned", "reward")):
        for column, (along, label) in enumerate(AXES):
            axes = grid[row][column]
            _draw(axes, curves, along, name)
            for style, (baseline, shares) in zip(STYLES, baselines.items(), strict=False):
                axes.axhline(
                    getattr(shares, name),
                    color="black",
                    linewidth=1,
                    linestyle=style,
                    label=baseline,
                )
            if row < 2:
                axes.set_ylim(0, 1)
            else:
                axes.set_xlabel(label)
            axes.grid(alpha=0.3)
        grid[row][0].set_ylabel("reward of an episode" if name == "reward" else f"{name} [share]")
    grid[0][-1].legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
    figure.savefig(path, dpi=RESOLUTION)


def _draw(axes: Axes, curves: Mapping[str, Sequence[CurvePoint]], along: str, name: str) -> None:
    for number, (label, points) in enumerate(curves.items()):
        colour = f"C{number}"
        counted = [point for point in points if point.episodes >= FEWEST]
        axes.plot(
            [getattr(point, along) for point in counted],
            [getattr(point, name) for point in counted],
            color=colour,
            linewidth=0.7,
            alpha=0.7,
            label=f"{label}, exploring",
        )
        seen = [point for point in points if point.evaluated]
        axes.plot(
            [getattr(point, along) for point in seen],
            [getattr(point, f"evaluated_{name}") for point in seen],
            ".-",
            color=colour,
            linewidth=1.8,
            label=label,
        )
