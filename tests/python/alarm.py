"""SIGALRM inside a block."""

import contextlib
import signal
from collections.abc import Iterator


@contextlib.contextmanager
def alarm_in(seconds: float) -> Iterator[None]:
    """The signal comes in the block; on a slow machine before its first call."""
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
