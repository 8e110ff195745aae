"""Evaluates policies: `python -m o80_table_tennis.evaluate learned scripted --balls wide`.

Every policy plays the same balls. Prints a table and draws the landings.
"""

from __future__ import annotations

import sys
from dataclasses import asdict, replace
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import Progress

import o80
from o80.base.finite import json_text
from o80.base.screen import keep_printing

from .balls.simulated_shots import DISTRIBUTIONS
from .ending import ends_in_order
from .learning.paired import Paired
from .players.conditions import Conditions
from .players.hitting_policy import HittingSettings
from .players.learned_policy import LearnedPolicy, shipped_policy
from .players.policies import DEFAULT_FACTOR, Policy, RandomPolicy, StillPolicy, default_policy
from .playing import VERDICT_BALLS, VERDICT_SEED, evaluate
from .report.report import print_table
from .report.statistics import Played
from .settings import Pacing


def main(
    policies: Annotated[
        list[str],
        typer.Argument(
            help="still, random, scripted, learned, or the folder or policy.npz of a training."
        ),
    ],
    balls: Annotated[
        str | None,
        typer.Option(help="wide, narrow, launcher, or recordings. [default: of the policy]"),
    ] = None,
    goal: Annotated[
        str | None, typer.Option(help="return or smash. [default: of the policy]")
    ] = None,
    count: Annotated[
        int | None,
        typer.Option(min=1, help="How many of them. [default: 400, or all of a recording]"),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of simulated balls and noise.")] = VERDICT_SEED,
    preset: Annotated[
        str | None, typer.Option(help="Of the arm: standard, identified, published_simulation.")
    ] = None,
    real_time: Annotated[
        bool, typer.Option(help="Play the same balls in real time too, the arm in its process.")
    ] = False,
    output: Annotated[Path, typer.Option(help="Folder that is written.")] = Path("build/evaluate"),
) -> None:
    """Plays the same balls with each policy, and compares."""
    from .learning.landing_plot import plot_landings

    console = Console()
    given = {"balls": balls, "goal": goal, "preset": preset}
    changed = {name: each for name, each in given.items() if each is not None}
    pacings = [Pacing.INLINE, Pacing.REAL_TIME] if real_time else [Pacing.INLINE]
    played: dict[str, Played] = {}
    try:
        with Progress(console=console, transient=True) as bars:
            for name, pacing in product(policies, pacings):
                policy, conditions = named_policy(name, **changed)
                simulated = conditions.balls in DISTRIBUTIONS
                total = VERDICT_BALLS if count is None and simulated else count
                bars.add_task(f"{name}, {pacing.value}", total=total)
                played[f"{name}, {pacing.value}" if real_time else name] = evaluate(
                    policy,
                    conditions,
                    balls=total,
                    seed=seed,
                    pacing=pacing,
                    after_each=lambda _: bars.advance(bars.tasks[-1].id),
                )
    except (ValueError, OSError, o80.Error) as error:
        print(f"o80: {error}", file=sys.stderr)
        raise typer.Exit(1) from error
    paired: dict[str, Paired] = {}
    if real_time:  # pairs: each policy accelerated, then in real time
        each_way = iter(played.values())
        paired = {name: Paired.of(next(each_way), next(each_way)) for name in policies}
    figures: dict[str, Any] = {label: each.as_json() for label, each in played.items()}
    print_table(console, "the same balls", figures)
    for name, pair in paired.items():
        console.print(f"{name}: {pair}", highlight=False)
    figures |= {f"{name}, paired": asdict(each) for name, each in paired.items()}
    output.mkdir(parents=True, exist_ok=True)
    plot_landings(output / "landings.png", played)
    (output / "evaluation.json").write_text(json_text(figures, indent=2) + "\n")
    console.print(f"landings.png, evaluation.json: {output}", soft_wrap=True)


def named_policy(name: str, **changed: str) -> tuple[Policy, Conditions]:
    """Loads a policy by name or training folder; returns its conditions, too, with `changed`.

    Raises ValueError or o80.InvalidArgument for an unknown policy.
    """
    conditions = Conditions()
    policy: Policy = RandomPolicy() if name == "random" else StillPolicy()
    if name == "scripted":
        conditions = Conditions(factor=DEFAULT_FACTOR, repeat=1, observation="published")
    elif name not in ("still", "random"):
        learned = shipped_policy() if name == "learned" else LearnedPolicy.load(name)
        policy, conditions = learned, learned.conditions
    conditions = replace(conditions, **changed)  # type: ignore[arg-type]
    if name == "scripted":
        policy = default_policy(HittingSettings.of_rig(conditions.rig()))
    return policy, conditions


if __name__ == "__main__":
    keep_printing()
    with ends_in_order():
        typer.run(main)
