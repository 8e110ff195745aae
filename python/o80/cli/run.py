"""``o80 run``: runs a robot in this process."""

import os
import sys
from pathlib import Path

import typer

from o80.base.installation import prefix
from o80.base.screen import style


def run(context: typer.Context) -> None:
    """Run a robot: [bold]o80 run ROBOT FLAGS[/bold].

    ROBOT is a name (see [bold]o80 run[/bold] alone), the path of a robot library, or a driver class
    in Python: module:Class or file.py:Class.
    [bold]o80 run ROBOT --help[/bold] lists the flags of this robot and those of every robot:
    --segment, --frequency, --bursting, --history, --policy, --cpus and more.
    The process becomes a C++ program (without Python, unless the driver is in Python); Ctrl-C stops
    it in order.
    """
    import o80.robots.robot as robots

    arguments = context.args
    if not arguments or arguments[0] in ("-h", "--help"):
        print(context.get_help())
        print(style("Robots", "bold"))
        for known in robots.list():
            print(f"  {known.name:<16} {known.path}")
        raise typer.Exit(0 if arguments else 2)
    robot, flags = arguments[0], arguments[1:]
    named = robot if robots.is_place(robot) else robots.found(robot)
    if isinstance(named, type):
        named = f"{named.__module__}:{named.__qualname__}"
    if isinstance(named, str):
        os.execv(sys.executable, [sys.executable, "-u", "-m", "o80.run_driver", named, *flags])
    if isinstance(named, tuple):
        given = {flag.partition("=")[0] for flag in flags}
        options = {"segment": robot, **named[1]()}
        flags += [f"--{key}={value}" for key, value in options.items() if f"--{key}" not in given]
        named = robots.path_of(named[0])
    program = Path(prefix()) / "bin" / "o80-run"
    os.execv(program, [str(program), str(named), *_with_face(flags)])


def _with_face(flags: list[str]) -> list[str]:
    """Returns the flags; in --like the name of a robot is replaced by the text of its face."""
    joined: list[str] = []
    for flag in flags:
        joined.append(f"{joined.pop()}={flag}" if joined and joined[-1] == "--like" else flag)
    for at, flag in enumerate(joined):
        if flag.startswith("--like="):
            import o80.robots.robot as robots

            joined[at] = f"--like={robots.face_text(flag.removeprefix('--like='))}"
    return joined
