"""``o80 ros2``: robots of o80 in ROS 2."""

import re
from contextlib import closing
from typing import Annotated

import typer

from o80.base.stop_request import StopRequest
from o80.errors import InvalidArgument
from o80_ros2 import ros
from o80_ros2.gateway import Gateway

app = typer.Typer(context_settings={"allow_interspersed_args": True}, subcommand_metavar="")
Names = Annotated[list[str] | None, typer.Argument(help="Segments (default: all that come).")]
Rates = Annotated[
    list[str] | None,
    typer.Option(
        help="Messages a second of each robot, or all for every row; NAME=RATE for one robot. "
        "Default: 100, above ten robots 20."
    ),
]
Command = Annotated[bool, typer.Option("--command", help="Take commands; otherwise only read.")]
Step = Annotated[
    int | None, typer.Option(min=1, help="A service `step`: so many iterations of a simulation.")
]
Prefix = Annotated[str, typer.Option(help="Before names of robots and joints: two arms apart.")]


def rates_of(texts: list[str]) -> dict[str, float]:
    """Parses rates by segment [Hz]: "" all others, 0 every row. Raises InvalidArgument if wrong."""
    found: dict[str, float] = {}
    for text in texts:
        name, _, word = text.rpartition("=")
        is_rate = re.fullmatch(r"\d*\.?\d+", word) and 0 < float(word) <= 10_000
        found[name] = float(word) if is_rate else 0.0
        if not is_rate and word != "all":
            raise InvalidArgument(
                f"--rate must be a number up to 10000, or all; NAME=RATE for one. Got '{text}'"
            )
    return found


@app.callback(invoke_without_command=True)
def ros2(
    names: Names = None,
    rate: Rates = None,
    command: Command = False,
    step: Step = None,
    prefix: Prefix = "",
) -> None:
    """Publish robots in ROS 2, and take commands for them (docs/ros2.md)."""
    settings = ros.Settings(rates_of(rate or []), command, step, prefix)
    stop = StopRequest()
    with closing(Gateway(names or [], settings)) as gateway:
        gateway.run(stop)
