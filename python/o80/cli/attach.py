"""How commands attach: at once, or not at all unless they are told to wait."""

from __future__ import annotations

import o80
from o80.cli.screen import complain


def attach(segment: str, *, wait: bool | None = None, read_only: bool = True) -> o80.Frontend:
    """A frontend of a segment that is there, dead ones too if it only reads.

    wait: for one that is not there yet, saying so; None: the command has no such flag.
    """
    try:
        return o80.Frontend(segment, 0.0, read_only=read_only, dead=read_only and not wait)
    except o80.TimeoutError as error:
        if wait is None:
            raise
        if not wait:
            raise o80.TimeoutError(f"{error} With --wait, echo waits for it.") from None
        complain(f"waiting; Ctrl-C ends it. {error}")
    return o80.Frontend(segment, None, read_only=read_only)
