"""``o80 resume``: clears a halt."""

from typing import Annotated

import typer

from o80.base.errors import InvalidArgument
from o80.cli.attach import attach


def resume(
    segment: Annotated[str, typer.Argument(help="Name of a segment; see o80 list.")],
    number: Annotated[
        str | None, typer.Argument(help="Number of the halt (default: the one in force).")
    ] = None,
    timeout: Annotated[
        float, typer.Option(help="Seconds to wait until the robot is at rest.")
    ] = 5.0,
    accept_reading: Annotated[
        bool,
        typer.Option(
            "--accept-reading",
            help="Go on from where the robot is read to be, even if it cannot be there.",
        ),
    ] = False,
) -> None:
    """Clear a halt: the robot makes a fresh start at its present position, with empty queues."""
    chosen = None if number is None else _number(number, segment)
    with attach(segment, read_only=False) as frontend:
        acting = frontend.halted
        if acting is None:
            print(f"{segment} is not halted")
            return
        resumed = frontend.resume(
            acting.number if chosen is None else chosen,
            timeout=timeout,
            accept_reading=accept_reading,
        )
        print(f"{segment} has resumed" if resumed else f"{segment} is not halted")


def _number(text: str, segment: str) -> int:
    if not text.isdecimal() or int(text) == 0:
        raise InvalidArgument(
            f"the number of a halt must be a positive whole number, got '{text}': "
            f"`o80 info {segment}` shows it; without a number the halt in force is cleared"
        )
    return int(text)
