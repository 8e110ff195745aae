"""``o80 list``: lists the backends of this machine."""

from __future__ import annotations

from typing import Annotated

import typer

from o80.cli.segment_table import print_segments


def list_segments(
    as_json: Annotated[bool, typer.Option("--json", help="For scripts.")] = False,
) -> None:
    """List the backends of this machine, also dead ones: state, rate, overruns, last row."""
    print_segments(as_json=as_json)
