"""How well policies play: `python -m o80_table_tennis.evaluate learned scripted --balls wide`.

Every policy plays the same balls. Prints a table and draws where the balls landed.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import Progress

import o80

from .ending import unwind_on_sigterm
from .learning.contestants import contestant
from .learning.evaluation import VERDICT_BALLS, VERDICT_SEED, Evaluation, evaluate
from .learning.paired import Paired
from .learning.verdict import print_table, write_report
from .settings import Pacing


@dataclass(frozen=True)
class Match:
    """Balls, arm and number of episodes that all compared policies share."""

    balls: str | None
    preset: str | None
    count: int | None
    seed: int


def main(
    policies: Annotated[
        list[str],
        typer.Argument(
            help="still, random, scripted, scripted_chunks (30 ms ahead), learned, or a file "
            "policy.npz."
        ),
    ],
    balls: Annotated[
        str | None,
        typer.Option(help="wide, narrow, launcher, or recordings. [default: of the policy]"),
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
    unwind_on_sigterm()
    console = Console()
    match = Match(balls, preset, count, seed)
    pacings = [Pacing.INLINE, Pacing.REAL_TIME] if real_time else [Pacing.INLINE]
    try:
        with Progress(console=console, transient=True) as bars:
            played = [
                _play(name, match, pacing, bars, named=len(pacings) > 1)
                for name in policies
                for pacing in pacings
            ]
    except (ValueError, OSError, o80.Error) as error:
        print(f"o80: {error}", file=sys.stderr)
        raise typer.Exit(1) from error
    print_table(played, console)
    paired = _paired(policies, played) if real_time else {}
    for name, pair in paired.items():
        console.print(f"{name}: {pair}", highlight=False)
    _write(played, paired, output, console)


def _play(name: str, match: Match, pacing: Pacing, bars: Progress, *, named: bool) -> Evaluation:
    policy, conditions = contestant(name, balls=match.balls, preset=match.preset)
    simulated = conditions.balls in ("wide", "narrow", "launcher")
    count = VERDICT_BALLS if match.count is None and simulated else match.count
    label = f"{name}, {pacing.value}" if named else name
    bar = bars.add_task(label, total=count)
    return evaluate(
        label,
        policy,
        conditions,
        balls=count,
        seed=match.seed,
        pacing=pacing,
        after_each=lambda _: bars.advance(bar),
    )


def _paired(policies: list[str], played: list[Evaluation]) -> dict[str, Paired]:
    """By policy; each was played accelerated, then in real time."""
    ways = zip(played[::2], played[1::2], strict=True)
    return {name: Paired.of(*each) for name, each in zip(policies, ways, strict=True)}


def _write(
    played: list[Evaluation], paired: dict[str, Paired], output: Path, console: Console
) -> None:
    from .learning.landing_plot import plot_landings

    output.mkdir(parents=True, exist_ok=True)
    plot_landings(output / "landings.png", played)
    figures: dict[str, Any] = {each.name: each.as_json() for each in played}
    figures |= {f"{name}, paired": each.as_json() for name, each in paired.items()}
    write_report(output / "evaluation.json", figures)
    console.print(f"landings.png, evaluation.json: {output}", soft_wrap=True)


if __name__ == "__main__":
    typer.run(main)
