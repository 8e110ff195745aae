"""Texts for terminals (tables that fit, JSON, errors on stderr) and tables for notebooks."""

from __future__ import annotations

import json
import os
import shutil
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any, TextIO

_CODES = {"bold": "1", "dim": "2", "red": "31", "green": "32", "yellow": "33"}


def style(text: str, name: str, stream: TextIO | None = None) -> str:
    """The text in a colour or weight, if the stream is a terminal."""
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
    """An HTML table; all texts are escaped, because other users may have written them."""
    lines = [f"<p>{escape(above)}</p>"] if above else []
    cells = "".join(f"<th>{escape(head)}</th>" for head in heads)
    lines.append(f"<table><thead><tr>{cells}</tr></thead><tbody>")
    for row in rows:
        cells = "".join(f"<td>{escape(str(cell))}</td>" for cell in row)
        lines.append(f"<tr>{cells}</tr>")
    return "\n".join([*lines, "</tbody></table>"])


def print_json(value: Any) -> None:
    """Prints one JSON document."""
    json.dump(value, sys.stdout, indent=2)
    sys.stdout.write("\n")


def plain(text: str) -> str:
    """A text of one line, from shared memory or a recording: it must not control the terminal."""
    return "".join(c if c.isprintable() else "?" for c in text)


def bytes_text(size: float) -> str:
    """A number of bytes with its unit."""
    if size >= 1e9:
        return f"{size / 1e9:.1f} GB"
    return f"{size / 1e6:.1f} MB" if size >= 1e5 else f"{size / 1e3:.1f} kB"


def complain(text: str) -> None:
    """Prints an error or a remark on stderr."""
    sys.stdout.flush()
    said = "\n".join(map(plain, text.split("\n")))
    print(f"{style('o80:', 'red', sys.stderr)} {said}", file=sys.stderr, flush=True)
