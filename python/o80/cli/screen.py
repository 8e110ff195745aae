"""How the command line prints: tables that fit a terminal, JSON for scripts, errors on stderr."""

from __future__ import annotations

import json
import sys
from typing import Any

from rich.console import Console
from rich.markup import escape

out = Console(highlight=False, soft_wrap=False)
err = Console(stderr=True, highlight=False)


def print_json(value: Any) -> None:
    """One JSON document, ready for a script."""
    json.dump(value, sys.stdout, indent=2)
    sys.stdout.write("\n")


def complain(text: str) -> None:
    """An error, as a person reads it."""
    err.print(f"[red]o80:[/red] {escape(text)}", soft_wrap=True, markup=True)
