"""Figures of played episodes, and tables of figures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table as Grid

from ..world.timing import ITERATIONS
from .statistics import Played

Figures = dict[str, Any]
PERCENTILES = (50, 90, 99, 99.9, 100)

LABELS = {
    "episodes": "episodes",
    "balls": "balls",
    "returned": "returned",
    "returned_95_percent": "returned (95 % interval)",
    "touched": "touched",
    "reward": "mean reward",
    "miss": "miss of the target, median [m]",
    "speed": "speed after the touch, median [m/s]",
    "steps": "steps of the environment",
    "steps_per_second": "steps a second, policy included [1/s]",
    "bare_steps_per_second": "steps a second, policy left out [1/s]",
    "times_real_time": "times as fast as real time",
    "late_actions": "actions taken late",
    "stalled_episodes": "episodes given up as stalled",
    "largest_lateness_rows": "largest lateness of a step [rows]",
    "mean_lateness_rows": "mean lateness of a step [rows]",
    "arm_iterations": "iterations of the arm",
    "arm_rate": "iterations of the arm a second [1/s]",
    "arm_overruns": "overruns of the arm",
    "arm_skipped": "periods the arm left out",
    "recorded_episodes": "episodes in the recording",
    "seconds": "seconds played",
    "arm_lateness_us": "arm late by at most, {} % of rows [us]",
    "arm_jitter_us": "arm period off by, {} % of rows [us]",
}
"""Labels by figure name; names of percentiles end in "_p" and the percentage."""
SHARES = ("touched", "returned", "returned_95_percent")  #: shown as percents unless they are counts


def print_table(console: Console, title: str, columns: Mapping[str, Mapping[str, Any]]) -> None:
    """Prints a row for each figure with a label."""
    grid = Grid(title=title, title_justify="left")
    grid.add_column("")
    for name in columns:
        grid.add_column(escape(name), justify="right", max_width=44 // len(columns))
    for key in dict.fromkeys(key for figures in columns.values() for key in figures):
        name, _, percentile = key.rpartition("_p")
        if label := LABELS.get(key) or LABELS.get(name):
            values = [_text(key, figures.get(key)) for figures in columns.values()]
            grid.add_row(escape(label.format(percentile)), *values)
    console.print(grid)


def _text(key: str, value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, list):
        return " to ".join(_text(key, each) for each in value).replace(" % to", " to")
    if not isinstance(value, float):
        return str(value)
    return f"{100 * value:.3g} %" if key in SHARES else f"{value:g}"


def mode_figures(played: Played, recorded: int) -> Figures:
    """Collects all figures of a mode. recorded: number of recorded episodes."""
    statistics = played.statistics
    figures: Figures = {
        "episodes": len(played.episodes),
        "returned": played.returns,
        "touched": played.touches,
        "reward": round(played.reward, 4),
        "steps": statistics.steps,
        "steps_per_second": round(statistics.steps_per_second, 1),
        "bare_steps_per_second": round(statistics.bare_steps_per_second, 1),
        "times_real_time": round(statistics.steps_per_second * statistics.step_seconds, 2),
        "arm_iterations": statistics.arm_iterations,
        "recorded_episodes": recorded,
        "seconds": round(played.seconds, 2),
    }
    if len(statistics.arm_periods_us):  # by the clock
        period = 1e6 * statistics.step_seconds / ITERATIONS
        figures |= {
            "late_actions": statistics.late_actions,
            "stalled_episodes": statistics.stalled_episodes,
            "mean_lateness_rows": round(statistics.mean_lateness, 3),
            "largest_lateness_rows": statistics.largest_lateness,
            "arm_rate": round(statistics.arm_rate, 2),
            "arm_overruns": statistics.arm_overruns,
            "arm_skipped": statistics.arm_skipped,
        }
        for name, values in (
            ("arm_lateness_us", statistics.arm_lateness_us),
            ("arm_jitter_us", np.abs(statistics.arm_periods_us - period)),
        ):
            for percentile in PERCENTILES:
                value = float(np.percentile(values, percentile))
                figures[f"{name}_p{percentile:g}"] = round(value, 1)
    return figures
