"""The verdict on a training: its policy and the baselines on fresh balls, as table and report."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from ..players.conditions import Conditions
from ..players.policies import RandomPolicy, StillPolicy
from ..world.table import TARGET
from .evaluation import VERDICT_BALLS, Evaluation, evaluate

REPORT = "report.json"
"""The file in the folder of a training."""


def baselines(conditions: Conditions, *, balls: int = VERDICT_BALLS) -> list[Evaluation]:
    """A still arm and random actions, under the same conditions."""
    return [
        evaluate("still arm", StillPolicy(), conditions, balls=balls),
        evaluate("random actions", RandomPolicy(), conditions, balls=balls),
    ]


def print_table(evaluations: Sequence[Evaluation], console: Console) -> None:
    """A row for each policy."""
    table = Table()
    for name in ("policy", "balls", "touched", "returned", "reward", "median miss of the target"):
        table.add_column(name, justify="left" if name == "policy" else "right")
    for each in evaluations:
        apart = each.distance(TARGET)
        table.add_row(
            each.name,
            str(len(each.episodes)),
            f"{100 * each.touched:.1f} %",
            f"{100 * each.returned:.1f} %",
            f"{each.reward:.3f}",
            "" if apart != apart else f"{apart:.2f} m",
        )
    console.print(table)


def write_report(path: Path, figures: dict[str, Any]) -> None:
    """A file of figures."""
    path.write_text(json.dumps(figures, indent=2) + "\n")
