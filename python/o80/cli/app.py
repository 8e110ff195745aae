"""The program ``o80``: one command a file."""

import importlib
from typing import Annotated

import typer

import o80._core as _core
from o80.base import installation, progress

COMMANDS = {
    "demo": "demo.demo",
    "run": "run.run",
    "doctor": "doctor.doctor",
    "list": "list_segments.list_segments",
    "info": "info.info",
    "stub": "stub.stub",
    "echo": "echo.echo",
    "record": "record.record",
    "save": "save.save",
    "repair": "save.repair",
    "cut": "cut.cut",
    "merge": "cut.merge",
    "recordings": "recordings.recordings",
    "play": "play.play",
    "plot": "plot.plot",
    "view": "view.view",
    "film": "film.film",
    "export": "export.export",
    "diff": "diff.diff",
    "latency": "latency.latency",
    "replay": "replay.replay",
    "teleop": "teleop.teleop",
    "mark": "mark.mark",
    "halt": "halt.halt",
    "resume": "resume.resume",
    "stop": "stop.stop",
    "clean": "clean.clean",
}
"""Module and function of each command, in the order of the help."""
RAW = {"ignore_unknown_options": True, "allow_extra_args": True}

app = typer.Typer(
    name="o80",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    suggest_commands=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="A first try: [bold]o80 demo[/bold]; then [bold]o80 run two_joints[/bold] here, "
    "[bold]o80 list[/bold] and [bold]o80 echo two_joints[/bold] in another terminal.",
)


@app.callback(invoke_without_command=True)
def root(
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
    prefix: Annotated[
        bool, typer.Option("--prefix", help="Print where o80 is installed, for CMake's o80_ROOT.")
    ] = False,
) -> None:
    """Run robots, see what runs, read it, stop it."""
    if version:
        typer.echo(_core.version())
        raise typer.Exit()
    if prefix:
        typer.echo(installation.prefix())
        raise typer.Exit()


def run_app(words: list[str]) -> None:
    """Runs the command at the begin of `words`, or lists all commands.

    Only the module of that command is imported: others import slow packages. Installed
    packages add commands by entry points of the group `o80.commands`, each a typer.Typer.
    """
    progress.of_a_command = True
    named = words[0] if words else ""
    added = {} if named in COMMANDS else installation.announced("o80.commands")
    for name in [named] if named in COMMANDS or named in added else [*COMMANDS, *added]:
        register(name)
    app(words)


def register(name: str) -> None:
    """Imports a command of o80 or of an installed package, and adds it to `app`."""
    if name not in COMMANDS:
        app.add_typer(installation.announced("o80.commands")[name].load(), name=name)
        return
    module, function = COMMANDS[name].split(".")
    command = getattr(importlib.import_module(f"o80.cli.{module}"), function)
    if name in ("run", "demo"):  # options of robots and of packages are not typer's
        app.command(name, context_settings=RAW, add_help_option=name != "run")(command)
    else:
        app.command(name)(command)
