"""``o80 stub``: writes a typed Python module for a robot."""

from pathlib import Path
from typing import Annotated

import typer

from o80.base.unwritable import writing
from o80.cli.attach import attach
from o80.frontend.robot_stub import module_of
from o80.frontend.segments import segments as all_segments


def stub(
    name: Annotated[
        str,
        typer.Argument(help="A segment, see o80 list; or a robot, which need not run."),
    ],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="File to write (default: print it).")
    ] = None,
) -> None:
    """Write a typed Python module for a robot: editors and type checkers then know its names.

    o80 stub arm -o my_arm.py, and in a program: from my_arm import attach
    """
    if any(entry.name == name and entry.readable for entry in all_segments()):
        with attach(name) as frontend:
            text = module_of(frontend.schema, name)
    else:
        import o80.robots.robot as robots

        text = module_of(robots.load(name).describe())
    if output is None:
        print(text, end="")
    else:
        with writing(output):
            output.write_text(text, encoding="utf-8")
