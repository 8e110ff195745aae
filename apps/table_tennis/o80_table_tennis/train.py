"""Learning to return balls from scratch: `python -m o80_table_tennis.train`.

Trains Stable-Baselines3's PPO in accelerated environments, then plays the policy on fresh balls.
Writes the learning curve, checkpoints, the policy and a report; needs the extra `learn`.
"""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

import o80
from o80.base.extras import needed

from .ending import unwind_on_sigterm

if TYPE_CHECKING:
    from .learning.settings import LearningSettings

OUTPUT = Path("build/learn")


def main(
    seed: Annotated[int, typer.Option(min=0, help="Another seed, another training.")] = 1,
    decisions: Annotated[
        int | None, typer.Option(min=1, help="After which it ends. [default: of the way]")
    ] = None,
    minutes: Annotated[
        float | None, typer.Option(help="Processor time after which it ends at the latest.")
    ] = None,
    way: Annotated[str, typer.Option(help="Set of settings: ours or published.")] = "ours",
    balls: Annotated[
        str | None,
        typer.Option(help="To train with: wide, narrow, launcher, or recordings. [default: wide]"),
    ] = None,
    blind: Annotated[bool, typer.Option(help="Train without seeing the ball: a baseline.")] = False,
    blind_share: Annotated[
        float,
        typer.Option(min=0, max=1, help="Then train a blind policy, for this share of decisions."),
    ] = 0.0,
    recorded: Annotated[
        Path | None, typer.Option(help="Recordings that the finished policy plays too.")
    ] = None,
    evaluated: Annotated[int, typer.Option(min=1, help="Fresh balls for the verdict.")] = 400,
    output: Annotated[Path, typer.Option(help="Folder that is written.")] = OUTPUT,
    resume: Annotated[bool, typer.Option(help="Go on from the checkpoint in the folder.")] = False,
) -> None:
    """Learns to return balls, and says how well."""
    unwind_on_sigterm()
    console = Console()
    try:
        for module in ("torch", "stable_baselines3"):
            needed(module, "learn", "learning", package="o80-table-tennis")
        settings = chosen(
            way,
            seed=seed,
            blind=blind,
            balls=balls,
            decisions=decisions,
            minutes=minutes,
        )
        from .learning.session import Session

        session = Session(settings, output, console, evaluated=evaluated)
        session.run(resume=resume, blind_share=blind_share, recorded=recorded)
    except (ValueError, o80.Error) as error:
        print(f"o80: {error}", file=sys.stderr)
        raise typer.Exit(1) from error
    except KeyboardInterrupt:
        print(f"stopped; go on with the same command and --resume ({output})", file=sys.stderr)
        raise typer.Exit(130) from None


def chosen(
    way: str, *, balls: str | None, minutes: float | None, **changed: Any
) -> LearningSettings:
    """A set of settings, with what was given instead. Raises ValueError."""
    from .learning.settings import WAYS

    if way not in WAYS:
        raise ValueError(f"unknown way '{way}'; there are: {', '.join(WAYS)}")
    settings = WAYS[way]
    given = {name: value for name, value in changed.items() if value is not None}
    return replace(
        settings,
        conditions=settings.conditions.playing(balls),
        minutes=math.inf if minutes is None else minutes,
        **given,
    )


if __name__ == "__main__":
    typer.run(main)
