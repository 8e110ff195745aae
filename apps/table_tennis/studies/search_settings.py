"""The search for the settings of the training: `python search_settings.py`.

Each trial changes some settings of the default ones, and trains as long as the others, with seeds
that no published training has. Writes a table, the best trial first.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console

from o80_table_tennis.learning import curve
from o80_table_tennis.learning.curve import CURVE
from o80_table_tennis.learning.settings import LearningSettings, PpoSettings
from o80_table_tennis.learning.training import Training
from o80_table_tennis.learning.verdict import write_report
from o80_table_tennis.players.conditions import Conditions

FIRST_SEED = 101
"""First seed of the trials; published trainings have seeds below."""

TRIALS: Mapping[str, Mapping[str, Any]] = {
    "default": {},
    "learning rate 3e-4": {"learning_rate": 3e-4},
    "learning rate 2e-3": {"learning_rate": 2e-3},
    "factor 0.3": {"factor": 0.3},
    "factor 1": {"factor": 1.0},
    "repeat 1": {"repeat": 1},
    "repeat 3": {"repeat": 3},
    "less exploration": {"log_exploration": -1.0},
    "more exploration": {"log_exploration": 0.0},
    "entropy 0.003": {"entropy": 0.003},
    "discount 0.98": {"discount": 0.98},
    "shorter rollouts": {"steps": 32, "batch": 256},
    "10 epochs": {"epochs": 10},
    "hidden 128": {"hidden": 128},
    "exploration by schedule": {"last_log_exploration": -1.2},
    "hidden 384": {
        "hidden": 384,
        "epochs": 12,
        "learning_rate": 5e-4,
        "last_log_exploration": -1.2,
    },
    "published observation": {"observation": "published"},
    "published reward": {"reward": "published"},
}


def changed(settings: LearningSettings, changes: Mapping[str, Any]) -> LearningSettings:
    """The settings with some values of PPO or of the conditions replaced by name."""
    ppo = {each.name for each in fields(PpoSettings)}
    conditions = {each.name for each in fields(Conditions)}
    unknown = set(changes) - ppo - conditions
    if unknown:
        raise ValueError(f"no setting is named {', '.join(sorted(unknown))}")
    return replace(
        settings,
        ppo=replace(settings.ppo, **{k: v for k, v in changes.items() if k in ppo}),
        conditions=replace(
            settings.conditions, **{k: v for k, v in changes.items() if k in conditions}
        ),
    )


def main(
    decisions: Annotated[int, typer.Option(min=1, help="Of each training.")] = 300_000,
    seeds: Annotated[int, typer.Option(min=1, help="Of each trial.")] = 2,
    only: Annotated[str, typer.Option(help="Trials whose names contain this.")] = "",
    output: Annotated[Path, typer.Option(help="Folder that is written.")] = Path("build/search"),
) -> None:
    """Trains with different settings, and compares what they have learned."""
    console = Console()
    found: dict[str, dict[str, Any]] = {}
    for name, changes in TRIALS.items():
        if only not in name:
            continue
        touched, returned = [], []
        for number in range(seeds):
            settings = replace(
                changed(LearningSettings(), changes),
                seed=FIRST_SEED + number,
                decisions=decisions,
                evaluate_every=decisions,
                evaluated=200,
            )
            folder = output / name.replace(" ", "_") / str(settings.seed)
            with Training(settings, folder) as training:
                training.run()
            last = curve.read(folder / CURVE)[-1]
            touched.append(last.evaluated_touched)
            returned.append(last.evaluated_returned)
        found[name] = {"changes": dict(changes), "touched": touched, "returned": returned}
        console.print(
            f"{name:24s} touched {np.mean(touched):.3f}, returned {np.mean(returned):.3f} "
            f"({', '.join(f'{each:.3f}' for each in returned)})",
            highlight=False,
        )
        best_first = sorted(found.items(), key=lambda item: -np.mean(item[1]["returned"]))
        write_report(output / "search.json", {"decisions": decisions, "trials": dict(best_first)})


if __name__ == "__main__":
    typer.run(main)
