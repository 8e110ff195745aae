"""The report of a demo: the same numbers as a table and as report.json."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table as Grid

from o80.base.finite import json_text

from ..settings import Pacing
from ..world.timing import ITERATIONS
from .recorded_episodes import RecordedEpisode
from .statistics import Played

Value = float | int | bool | str | None
PERCENTILES = (50, 90, 99, 99.9, 100)

LABELS = {
    "episodes": "episodes",
    "returned": "returned to the opponent's half",
    "touched": "touched by the racket",
    "reward": "mean reward",
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
    "returned_at_least": "share returned, at least (95 % sure)",
    "returned_at_most": "share returned, at most (95 % sure)",
    "recorded_episodes": "episodes in the recording",
    "seconds": "seconds played",
}


@dataclass(frozen=True)
class Report:
    """The numbers of every mode, of every policy on the same balls, and of the whole."""

    modes: Mapping[str, Mapping[str, Value]]
    policies: Mapping[str, Mapping[str, Value]]
    whole: Mapping[str, Value]

    def print(self, console: Console) -> None:
        """A table with a column for each mode, one for each policy, then the whole demo."""
        console.print(_grid("table tennis", self.modes))
        console.print(_grid("the same balls with other policies", self.policies))
        for key, value in self.whole.items():
            console.print(f"{key.replace('_', ' ')}: {_text(value)}", highlight=False)

    def write(self, path: Path) -> None:
        """As JSON."""
        path.write_text(
            json_text({"modes": self.modes, "policies": self.policies, **self.whole}, indent=2)
            + "\n"
        )


def _grid(title: str, columns: Mapping[str, Mapping[str, Value]]) -> Grid:
    grid = Grid(title=title, title_justify="left")
    grid.add_column("")
    for name in columns:
        grid.add_column(escape(name), justify="right")
    rows = dict.fromkeys(key for numbers in columns.values() for key in numbers)
    for key in rows:
        values = [_text(numbers.get(key)) for numbers in columns.values()]
        grid.add_row(escape(LABELS.get(key, _percentile_label(key))), *values)
    return grid


def write_report(
    output: Path,
    modes: Mapping[Pacing, Played],
    policies: Mapping[str, Played],
    recorded: Mapping[Pacing, Sequence[RecordedEpisode]],
    *,
    begin: float,
) -> Report:
    """Writes report.json; `begin` is monotonic time [s]."""
    numbers = {
        pacing.value: mode_numbers(pacing, played, recorded[pacing])
        for pacing, played in modes.items()
    }
    others = {name: policy_numbers(played) for name, played in policies.items()}
    seconds = round(time.monotonic() - begin, 1)
    report = Report(modes=numbers, policies=others, whole={"seconds": seconds})
    report.write(output / "report.json")
    return report


def policy_numbers(played: Played) -> dict[str, Value]:
    """How well a policy played."""
    numbers = played.as_json()
    del numbers["ends"], numbers["speed"]
    low, high = numbers.pop("returned_95_percent")
    return numbers | {"returned_at_least": low, "returned_at_most": high}


def mode_numbers(
    pacing: Pacing, played: Played, recorded: Sequence[RecordedEpisode]
) -> dict[str, Value]:
    """All numbers of one mode."""
    statistics = played.statistics
    period = 1e6 * statistics.step_seconds / ITERATIONS
    numbers: dict[str, Value] = {
        "episodes": len(played.episodes),
        "returned": played.returns,
        "touched": played.touches,
        "reward": round(played.reward, 4),
        "steps": statistics.steps,
        "steps_per_second": round(statistics.steps_per_second, 1),
        "bare_steps_per_second": round(statistics.bare_steps_per_second, 1),
        "times_real_time": round(statistics.steps_per_second * statistics.step_seconds, 2),
        "arm_iterations": statistics.arm_iterations,
        "recorded_episodes": len(recorded),
        "seconds": round(played.seconds, 2),
    }
    if pacing.real_time:
        numbers |= {
            "late_actions": statistics.late_actions,
            "stalled_episodes": statistics.stalled_episodes,
            "mean_lateness_rows": round(statistics.mean_lateness, 3),
            "largest_lateness_rows": statistics.largest_lateness,
            "arm_rate": round(statistics.arm_rate, 2),
            "arm_overruns": statistics.arm_overruns,
            "arm_skipped": statistics.arm_skipped,
            **_percentiles("arm_lateness_us", statistics.arm_lateness_us),
            **_percentiles("arm_jitter_us", np.abs(statistics.arm_periods_us - period)),
        }
    return numbers


def _percentiles(name: str, values: Any) -> dict[str, Value]:
    return {
        f"{name}_p{percentile:g}": round(float(np.percentile(values, percentile)), 1)
        for percentile in PERCENTILES
        if len(values)
    }


def _percentile_label(key: str) -> str:
    name, _, percentile = key.rpartition("_p")
    what = {
        "arm_lateness_us": "arm late by at most",
        "arm_jitter_us": "arm period off by",
    }.get(name, name)
    return f"{what}, {percentile} % of rows [us]"


def _text(value: Value) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:g}" if isinstance(value, float) else str(value)
