"""Draws an evaluation: landings of the balls on the table."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from ..report.statistics import Played
from ..world.table import TABLE, TARGET

RESOLUTION = 110
"""[dots per inch]"""


def plot_landings(path: Path, evaluations: Mapping[str, Played]) -> None:
    """Draws the table from above for each evaluation, with the arm on the left."""
    figure = Figure(figsize=(8.5, 4.2 * len(evaluations)), layout="constrained")
    panels = figure.subplots(len(evaluations), 1, squeeze=False)[:, 0]
    for axes, (name, played) in zip(panels, evaluations.items(), strict=True):
        x, y, _ = TABLE.centre
        width, length, _ = TABLE.size
        near, left = y - length / 2, x - width / 2
        axes.add_patch(Rectangle((near, left), length, width, facecolor="tab:blue", alpha=0.25))
        axes.plot([y, y], [left, left + width], color="black", label="net")
        for returned, colour, label in (
            (True, "tab:green", "returned"),
            (False, "tab:red", "landed elsewhere"),
        ):
            landings = [each.landing for each in played.episodes if each.returned is returned]
            places = np.array([each for each in landings if each]).reshape(-1, 3)
            text, at = f"{label}: {len(places)}", (places[:, 1], places[:, 0])
            axes.plot(*at, "o", markersize=3.5, alpha=0.7, color=colour, label=text)
        star = {"markersize": 13, "color": "gold", "markeredgecolor": "black"}
        axes.plot(TARGET[1], TARGET[0], "*", label="target", **star)
        count = len(played.episodes)
        axes.set_title(
            f"{name}: {100 * played.returned:.1f} % of {count} balls returned, "
            f"{100 * played.touched:.1f} % touched",
            fontsize=10,
        )
        axes.set_xlabel("y, towards the opponent [m]")
        axes.set_ylabel("x, across [m]")
        axes.set_aspect("equal")
        axes.set_xlim(near - 0.4, near + length + 0.4)
        axes.set_ylim(left - 0.3, left + width + 0.3)
        axes.grid(alpha=0.3)
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
    figure.savefig(path, dpi=RESOLUTION)
