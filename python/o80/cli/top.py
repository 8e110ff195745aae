"""``o80 top``: the list of backends, again and again."""

from __future__ import annotations

import contextlib
import io
import sys
import time
from collections.abc import Iterator
from typing import Annotated

import typer

from o80.cli.segment_table import print_segments

_ALTERNATE, _USUAL = "\033[?1049h\033[?25l", "\033[?1049l\033[?25h"  # screen, without the cursor
LONGEST = 86400.0  # between two looks [s]
_HOME, _CLEAR_LINE, _CLEAR_BELOW = "\033[H", "\033[K", "\033[J"


def _interval(value: float) -> float:
    if not 0 < value <= LONGEST:
        raise typer.BadParameter(
            f"interval must be positive and at most {LONGEST:g} s, got {value:g}",
            param_hint="--interval",
        )
    return value


class _Page(io.StringIO):
    """Collects what is printed; takes colours if the terminal does."""

    def isatty(self) -> bool:
        return sys.__stdout__ is not None and sys.__stdout__.isatty()


def top(
    interval: Annotated[
        float, typer.Option(callback=_interval, help="Seconds between two looks.")
    ] = 1.0,
    count: Annotated[int, typer.Option(min=0, help="Stop after this many looks; 0: never.")] = 0,
) -> None:
    """Show the backends of this machine live, as o80 list does; Ctrl-C ends it."""
    with _screen() as terminal:
        looks = 0
        while True:
            page = _page()
            if terminal:
                lines = page.splitlines()
                sys.stdout.write(_HOME + "".join(f"{each}{_CLEAR_LINE}\n" for each in lines))
                sys.stdout.write(_CLEAR_BELOW)
            else:
                sys.stdout.write(page + "\n")
            sys.stdout.flush()
            looks += 1
            if looks == count:
                return
            time.sleep(interval)


def _page() -> str:
    page = _Page()
    with contextlib.redirect_stdout(page):
        print(time.strftime("%H:%M:%S"))
        print_segments(as_json=False)
    return page.getvalue()


@contextlib.contextmanager
def _screen() -> Iterator[bool]:
    """A screen of its own, if there is a terminal, which is left as it was."""
    terminal = sys.stdout.isatty()
    if terminal:
        sys.stdout.write(_ALTERNATE)
    try:
        yield terminal
    finally:
        if terminal:
            sys.stdout.write(_USUAL)
            sys.stdout.flush()
