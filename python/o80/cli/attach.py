"""How commands attach: at once, or with --wait as soon as the backend starts."""

from __future__ import annotations

import o80
from o80.cli.screen import complain


def attach(segment: str, *, wait: bool | None = None, read_only: bool = True) -> o80.Frontend:
    """A frontend of an existing segment; a read-only one also attaches to a dead segment.

    wait: True waits for a segment that does not exist yet and says so; None: the command has no
        flag --wait.
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
