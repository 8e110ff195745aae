"""The command line: ``o80 run | list | info | echo | record | ...``, one command a file."""

import signal
import sys

from o80.base.errors import Error
from o80.base.refusals import explained
from o80.base.screen import complain, keep_printing, unprinted

__all__ = ["main"]


def main() -> None:
    """Entry point. Exceptions of o80 become one line and exit code 1."""
    keep_printing()
    code: str | int | None = 0
    try:
        with explained(f"do `o80 {' '.join(sys.argv[1:2])}`"):
            _run(sys.argv[1:])
    except Error as error:
        complain("\n".join([str(error), *getattr(error, "__notes__", ())]))
        code = 1
    except KeyboardInterrupt:
        code = 130
    except SystemExit as end:
        code = end.code
    sys.exit(code or unprinted())


def _run(words: list[str]) -> None:
    if words[:1] == ["halt"]:
        # first the halt: neither Ctrl-C nor the end of the terminal may come before it
        for number in (signal.SIGINT, signal.SIGHUP, signal.SIGQUIT, signal.SIGTSTP):
            signal.signal(number, signal.SIG_IGN)
        from o80.cli.halt import halt_words

        sys.exit(halt_words(words[1:]))
    # `o80 list` is used most: without typer, which takes long to import, it starts faster
    if words in (["list"], ["list", "--json"]):
        from o80.cli.segment_table import print_segments

        print_segments(as_json="--json" in words)
        return
    from o80.cli.app import run_app

    run_app(words)
