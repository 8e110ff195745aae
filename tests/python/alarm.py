"""Sends signals inside a block."""

import contextlib
import signal
from collections.abc import Callable, Iterator


@contextlib.contextmanager
def handling(number: int, handler: Callable[..., object]) -> Iterator[None]:
    """Installs a signal handler for the block."""
    before = signal.signal(number, handler)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(number, before)


@contextlib.contextmanager
def alarm_in(seconds: float) -> Iterator[None]:
    """Sends SIGALRM during the block; on a slow machine before its first call."""
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
