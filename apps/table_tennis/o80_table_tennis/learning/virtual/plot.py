"""The picture of the comparison: touched and returned against motions of the arm."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from .curves import column, common_motions, found
from .settings import WAYS

RESOLUTION = 110
"""[dots per inch]"""
PANELS = (("touched", "touched [share]"), ("returned", "returned [share]"), ("reward", "reward"))


def plot(folder: Path, path: Path, *, title: str) -> None:
    """Thick: median of the seeds; thin: each of them. Ways without a curve are left out."""
    figure = Figure(figsize=(13, 4.6), layout="constrained")
    figure.suptitle(title)
    panels = figure.subplots(1, len(PANELS), sharex=True)
    for axes, (name, label) in zip(panels, PANELS, strict=True):
        for number, (way, described) in enumerate(WAYS.items()):
            curves = found(folder, way)
            if not curves:
                continue
            motions, values = common_motions(curves), column(curves, name)
            colour = f"C{number}"
            for value in values:
                axes.plot(motions, value, color=colour, linewidth=0.7, alpha=0.5)
            median = np.median(values, axis=0)
            axes.plot(motions, median, ".-", color=colour, linewidth=2, label=described.text)
        axes.set_xlabel("motions of the arm")
        axes.set_ylabel(label)
        axes.grid(alpha=0.3)
    panels[0].set_ylim(0, 1)
    panels[1].set_ylim(0, 1)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    figure.savefig(path, dpi=RESOLUTION)
