"""The program ``o80``: gathers the commands, one a file."""

from __future__ import annotations

from typing import Annotated

import typer

import o80._core as _core
from o80.base import installation
from o80.cli.clean import clean
from o80.cli.diff import diff
from o80.cli.echo import echo
from o80.cli.export import export
from o80.cli.halt import halt, resume
from o80.cli.info import info
from o80.cli.latency import latency
from o80.cli.list_segments import list_segments
from o80.cli.mark import mark
from o80.cli.play import play
from o80.cli.plot import plot
from o80.cli.record import record
from o80.cli.replay import replay
from o80.cli.run import run
from o80.cli.save import repair, save
from o80.cli.stop import stop
from o80.cli.stub import stub
from o80.cli.view import view

app = typer.Typer(
    name="o80",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    suggest_commands=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="A first try: [bold]o80 run two_joints[/bold] here, [bold]o80 list[/bold] and "
    "[bold]o80 echo two_joints[/bold] in another terminal.",
)
app.command(
    "run",
    context_settings={"ignore_unknown_options": True, "allow_extra_args": True},
    add_help_option=False,
)(run)
app.command("list")(list_segments)
app.command("info")(info)
app.command("stub")(stub)
app.command("echo")(echo)
app.command("record")(record)
app.command("save")(save)
app.command("repair")(repair)
app.command("play")(play)
app.command("plot")(plot)
app.command("view")(view)
app.command("export")(export)
app.command("diff")(diff)
app.command("latency")(latency)
app.command("replay")(replay)
app.command("mark")(mark)
app.command("halt")(halt)
app.command("resume")(resume)
app.command("stop")(stop)
app.command("clean")(clean)


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
