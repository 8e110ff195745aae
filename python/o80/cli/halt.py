"""``o80 halt`` and ``o80 resume``: the latched stop of a robot, and its end."""

from __future__ import annotations

from typing import Annotated

import typer

import o80
from o80.cli.screen import out


def halt(
    segment: Annotated[str, typer.Argument(help="Name of a segment; see o80 list.")],
    reason: Annotated[str, typer.Argument(help="Why: others read it.")] = "",
) -> None:
    """Halt a robot: commands end, it brakes, and nothing moves until it is resumed.

    Not a safety function: keep an emergency stop that needs no computer.
    """
    number = o80.halt(segment, reason)
    out.print(f"halt {number} of {segment}; go on with: o80 resume {segment} {number}")


def resume(
    segment: Annotated[str, typer.Argument(help="Name of a segment; see o80 list.")],
    number: Annotated[int | None, typer.Argument(help="Of the halt; default: this one.")] = None,
    timeout: Annotated[float, typer.Option(help="Seconds to wait for the backend.")] = 5.0,
) -> None:
    """Clear a halt: the robot starts afresh from where it is, with nothing queued."""
    with o80.Frontend(segment, timeout=1.0) as frontend:
        acting = frontend.halted
        if acting is None:
            out.print(f"{segment} is not halted")
            return
        frontend.resume(acting.number if number is None else number, timeout=timeout)
        out.print(f"{segment} has resumed")
