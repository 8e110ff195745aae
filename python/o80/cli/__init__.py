"""The command line: ``o80 run | list | info | echo | record | ...``, one command a file."""

from __future__ import annotations

import os
import sys

from o80.base.errors import Error
from o80.base.screen import complain

__all__ = ["main"]


def main() -> None:
    """Entry point. Exceptions of o80 become one line and exit code 1."""
    try:
        _run(sys.argv[1:])
    except Error as error:
        complain(str(error))
        sys.exit(1)
    except KeyboardInterrupt:
        sys.exit(130)
    except BrokenPipeError:  # `o80 echo arm | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)


def _run(words: list[str]) -> None:
    # `o80 list` is used most: without typer, which takes long to import, it starts faster
    if words in (["list"], ["list", "--json"]):
        from o80.cli.segment_table import print_segments

        print_segments(as_json="--json" in words)
        sys.stdout.flush()
        return
    from o80.cli.app import run_app

    run_app(words)
