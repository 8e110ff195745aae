"""``o80 list``: lists the backends of this machine."""

import io
import sys
import time
from typing import Annotated

import typer

from o80.base.screen import emit
from o80.cli.segment_table import print_segments

_ENTER, _LEAVE = "\033[?1049h\033[?25l", "\033[?1049l\033[?25h"  # another screen, without cursor
_CLEAR = "\033[H\033[J"


def list_segments(
    as_json: Annotated[bool, typer.Option("--json", help="For scripts.")] = False,
    watch: Annotated[
        bool, typer.Option("--watch", help="List again each second, until Ctrl-C.")
    ] = False,
) -> None:
    """List the backends of this machine, also dead ones: state, rate, overruns, last row."""
    if watch and as_json:
        raise typer.BadParameter("--json prints one list; leave out --watch")
    if watch:
        _watch()
    else:
        print_segments(as_json=as_json)


def _watch() -> None:
    """Prints the list each second; restores the terminal at the end."""
    terminal = sys.stdout.isatty()
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(line_buffering=False)  # a list is one write: it does not flicker
    try:
        print(end=_ENTER if terminal else "")
        while True:
            print(_CLEAR if terminal else "", time.strftime("%H:%M:%S"), sep="")
            print_segments(as_json=False)
            emit("", end="" if terminal else "\n")
            time.sleep(1.0)
    finally:
        print(end=_LEAVE if terminal else "", flush=True)
