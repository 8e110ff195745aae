"""``o80 mark``: note a line of text in the journal of a robot."""

from typing import Annotated

import typer

from o80.cli.attach import attach


def mark(
    segment: Annotated[str, typer.Argument(help="Name of a segment; see o80 list.")],
    text: Annotated[str, typer.Argument(help="One line of text.")],
    timeout: Annotated[
        float, typer.Option(help="Seconds to wait until the robot has taken it.")
    ] = 5.0,
) -> None:
    """Leave a mark in a run: a line of text that recordings, `o80 plot` and `o80 view` show."""
    with attach(segment, read_only=False) as frontend:
        batch = frontend.mark(text)
        batch.wait(timeout)
        print(f"{segment}, iteration {batch[0].iteration}: {text}")
