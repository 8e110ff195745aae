"""How commands attach: at once, or with --wait as soon as the backend starts."""

from o80.base.errors import TimeoutError
from o80.base.screen import complain
from o80.frontend.frontend import Frontend


def attach(segment: str, *, wait: bool | None = None, read_only: bool = True) -> Frontend:
    """Attaches to an existing segment; a read-only frontend also attaches to a dead segment.

    wait: True waits for a segment that does not exist yet and reports it; None: the command has no
        flag --wait.
    """
    try:
        return Frontend(segment, 0.0, read_only=read_only, dead=read_only and not wait)
    except TimeoutError as error:
        if wait is None:
            raise
        if not wait:
            raise TimeoutError(f"{error} With --wait, echo waits for it.") from None
        complain(f"waiting; Ctrl-C ends it. {error}")
    return Frontend(segment, None, read_only=read_only)
