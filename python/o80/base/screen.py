"""Texts for terminals (tables that fit, JSON, errors on stderr) and tables for notebooks.

Programs of o80 call `keep_printing` first: after that no print raises.
"""

import errno
import functools
import io
import os
import shutil
import sys
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from html import escape
from typing import Any, TextIO

import o80._core as _core
from o80.base.descriptors import open_standard_streams
from o80.base.finite import json_text

_CODES = {"bold": "1", "dim": "2", "red": "31", "green": "32", "yellow": "33"}


def style(text: str, name: str, stream: TextIO | None = None) -> str:
    """Returns the text in a colour or weight, if the stream is a terminal."""
    out = sys.stdout if stream is None else stream
    if not name or "NO_COLOR" in os.environ or os.environ.get("TERM") == "dumb":
        return text
    return f"\033[{_CODES[name]}m{text}\033[0m" if out.isatty() else text


@dataclass(frozen=True)
class Column:
    """A column of a table."""

    name: str
    right: bool = False  #: aligned right, for numbers
    spare: int = 0  #: in a narrow terminal, columns with the largest value are left out first


def print_table(
    columns: Sequence[Column], rows: Sequence[Sequence[str]], styles: dict[str, str] | None = None
) -> None:
    """Prints a table; a cell whose text is a key of `styles` gets that style."""
    widths = [
        max(len(cell) for cell in cells) for cells in zip(_names(columns), *rows, strict=True)
    ]
    shown = list(range(len(columns)))
    if sys.stdout.isatty():
        narrow = shutil.get_terminal_size().columns
        for i in sorted(shown, key=lambda i: -columns[i].spare):
            if columns[i].spare and sum(widths[i] + 2 for i in shown) - 2 > narrow:
                shown.remove(i)
    for index, row in enumerate([_names(columns), *rows]):
        cells = []
        for i in shown:
            padded = f"{row[i]:>{widths[i]}}" if columns[i].right else f"{row[i]:<{widths[i]}}"
            chosen = "bold" if index == 0 else (styles or {}).get(row[i], "")
            cells.append(style(padded, chosen))
        print("  ".join(cells).rstrip())


def _names(columns: Sequence[Column]) -> list[str]:
    return [column.name for column in columns]


def html(heads: Sequence[str], rows: Iterable[Sequence[Any]], above: str = "") -> str:
    """Makes an HTML table; all texts are escaped, because other users may have written them."""
    lines = [f"<p>{escape(above)}</p>"] if above else []
    cells = "".join(f"<th>{escape(head)}</th>" for head in heads)
    lines.append(f"<table><thead><tr>{cells}</tr></thead><tbody>")
    for row in rows:
        cells = "".join(f"<td>{escape(str(cell))}</td>" for cell in row)
        lines.append(f"<tr>{cells}</tr>")
    return "\n".join([*lines, "</tbody></table>"])


def print_json(value: Any) -> None:
    """Prints one JSON document."""
    print(json_text(value, indent=2, say=complain_once))


def plain(text: str) -> str:
    """Makes a line from memory or a recording printable: it must not control the terminal."""
    return _core.printable(text)


def bytes_text(size: float) -> str:
    """Formats a number of bytes with its unit."""
    if size >= 1e9:
        return f"{size / 1e9:.1f} GB"
    return f"{size / 1e6:.1f} MB" if size >= 1e5 else f"{size / 1e3:.1f} kB"


def complain(text: str) -> None:
    """Prints an error or a remark on stderr; raises nothing if that cannot be written."""
    said = "\n".join(map(plain, text.split("\n")))
    with suppress(OSError, ValueError):
        sys.stdout.flush()
    with suppress(OSError, ValueError):
        print(f"{style('o80:', 'red', sys.stderr)} {said}", file=sys.stderr, flush=True)


def overwrite(text: str, end: str = "") -> None:
    """Prints a text on stderr; on a terminal it replaces the line that was printed before."""
    begin = "\r\033[K" if sys.stderr.isatty() else ""
    print(f"{begin}{text}", end=end, file=sys.stderr, flush=True)


@functools.cache
def complain_once(text: str) -> None:
    """Prints a remark on stderr unless this process has already printed it."""
    complain(text)


# ---------------------------------------------------------------------- prints that raise nothing


class _Output(io.FileIO):
    """A descriptor that drops bytes it cannot write: full device, closed pipe or descriptor."""

    failure: OSError | None = None  #: the first one

    def write(self, data: Any) -> int:
        try:
            written = super().write(data)
            if written is None:
                raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))
            return written
        except OSError as error:
            self.failure = self.failure or error
            return memoryview(data).nbytes


_stdout: _Output | None = None


def keep_printing() -> None:
    """Makes all prints of this program raise nothing, so that a message never ends long work.

    Replaces characters that the encoding lacks. Leaves captured streams alone. For programs, as the
    first call; a library leaves the streams of its host alone.
    """
    global _stdout
    open_standard_streams()
    for name, errors in (("stdout", "replace"), ("stderr", "backslashreplace")):
        stream = getattr(sys, name)
        if stream is not getattr(sys, f"__{name}__"):
            continue
        try:
            output = _Output(stream.fileno(), "wb", closefd=False)
        except (AttributeError, OSError):  # there is not even /dev/null
            continue
        setattr(
            sys,
            name,
            io.TextIOWrapper(
                output if stream.write_through else io.BufferedWriter(output),
                stream.encoding,
                errors,
                line_buffering=stream.line_buffering,
                write_through=stream.write_through,
            ),
        )
        if name == "stdout":
            _stdout = output


def emit(text: str, end: str = "\n") -> None:
    """Prints one of many texts; raises SystemExit if standard output accepts no more."""
    print(text, end=end, flush=True)
    if _stdout is not None and _stdout.failure is not None:
        raise SystemExit


def unprinted() -> int:
    """Returns the exit code by the output: 1, with a message, if something could not be printed.

    Returns 0 if the reader has closed the pipe (`o80 list | head`).
    """
    sys.stdout.flush()
    failure = None if _stdout is None else _stdout.failure
    if failure is None or failure.errno == errno.EPIPE:
        return 0
    complain(f"the standard output cannot be written: {failure.strerror}")
    return 1
