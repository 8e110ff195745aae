"""Trainings one after the other, and what their curves say."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.console import Console
from rich.table import Table

from ..curve import append
from . import curves
from .curves import Point
from .plot import plot
from .settings import WAYS, VirtualSettings
from .training import train

PICTURE = "virtual_balls.png"


def run(
    ways: Sequence[str],
    seeds: Sequence[int],
    folder: Path,
    console: Console,
    *,
    motions: int | None = None,
) -> None:
    """Trains where there is no curve yet. Raises ValueError for an unknown way."""
    torch.set_num_threads(1)
    of_length: dict[str, Any] = {} if motions is None else {"motions": motions}
    every = [VirtualSettings(way, seed, **of_length) for seed in seeds for way in ways]
    for settings in every:
        path = curves.file_of(folder, settings.way, settings.seed)
        if path.exists():
            console.print(f"{path} is there")
            continue
        unfinished = path.with_suffix(".part")
        unfinished.unlink(missing_ok=True)

        def tell(point: Point, settings: VirtualSettings = settings, to: Path = unfinished) -> None:
            append(to, point)
            console.print(
                f"{settings.way}, seed {settings.seed}: {point.motions} motions, "
                f"touched {point.touched:.2f}, returned {point.returned:.2f}, "
                f"{point.processor_minutes:.1f} min"
            )

        train(settings, tell)
        unfinished.rename(path)


def draw(folder: Path, console: Console) -> None:
    """The picture and the table of all curves in a folder."""
    found = {way: curves.found(folder, way) for way in WAYS}
    seeds = max(len(each) for each in found.values())
    title = f"Learning from one motion of the arm with one or with many balls ({seeds} seeds)"
    plot(folder, folder / PICTURE, title=title)
    table = Table()
    for name in ("way", "seeds", "motions", "gradient steps", "touched", "returned", "min"):
        table.add_column(name, justify="left" if name == "way" else "right")
    for way, its in found.items():
        if its and curves.common_motions(its):
            table.add_row(WAYS[way].text, str(len(its)), *_last(its))
    console.print(table)


def _last(its: Sequence[Sequence[Point]]) -> list[str]:
    """The last common point: median, and the least and most of the seeds."""
    motions = curves.common_motions(its)[-1]
    steps, minutes = (
        float(np.median(curves.column(its, name)[:, -1]))
        for name in ("gradient_steps", "processor_minutes")
    )
    shares = [_spread(curves.column(its, name)[:, -1]) for name in ("touched", "returned")]
    return [str(motions), f"{steps:.0f}", *shares, f"{minutes:.1f}"]


def _spread(values: np.ndarray) -> str:
    return f"{np.median(values):.2f} ({values.min():.2f} to {values.max():.2f})"
