"""``o80 latency``: the delay between two segments that record the same motion."""

import re
from collections.abc import Callable
from contextlib import ExitStack
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from o80.base.errors import InvalidArgument
from o80.cli.attach import attach

if TYPE_CHECKING:
    from o80.rows.history import History


def latency(
    first: Annotated[
        str, typer.Argument(help="SEGMENT:FIELD, for example arm:observed.elbow", metavar="A")
    ],
    second: Annotated[
        str,
        typer.Argument(help="Another one; norm(FIELD) is a length of several numbers", metavar="B"),
    ],
    recording: Annotated[
        str | None, typer.Option(help="A recording that holds both, instead of running robots.")
    ] = None,
    most: Annotated[
        float, typer.Option(help="Longest delay to look for, either way, in seconds.")
    ] = 0.5,
    seconds: Annotated[float | None, typer.Option(help="Only the last seconds.")] = None,
) -> None:
    """Estimate how much later B shows a motion than A, by cross-correlation.

    Move the robot back and forth, without a fixed rhythm, while both segments record it.
    """
    from o80.joining.latency import latency as estimate
    from o80.recording.reader import open as open_recording

    file = None if recording is None else open_recording(recording)
    with ExitStack() as opened:
        signals = []
        for text in (first, second):
            name, colon, field = text.partition(":")
            if not colon or not name or not field:
                raise InvalidArgument(
                    f"write SEGMENT:FIELD, for example arm:observed.elbow, not '{text}'"
                )
            source: Any = file[name] if file is not None else opened.enter_context(attach(name))
            signals.append((source, _signal(field)))
        print(f"{second} behind {first}: {estimate(*signals, most=most, seconds=seconds)}")


def _signal(text: str) -> "str | Callable[[History], Any]":
    """Parses a field, or norm(FIELD): the length of several numbers."""
    match = re.fullmatch(r"norm\((.+)\)", text)
    if match is None:
        return text
    path = match[1]
    return lambda rows: np.linalg.norm(rows[path].reshape(len(rows), -1), axis=1)
