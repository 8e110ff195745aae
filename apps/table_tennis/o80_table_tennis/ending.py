"""Ends a program cleanly on signals: the stack unwinds, and no process or segment remains."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_received: list[int] = []


@contextmanager
def ends_in_order() -> Iterator[None]:
    """Makes Ctrl-C, SIGTERM and SIGHUP raise SystemExit in the block; ignores a second signal."""

    def end(number: int, _frame: FrameType | None) -> None:
        for each in before:
            signal.signal(each, signal.SIG_IGN)
        _received.append(number)
        sys.exit(128 + number)

    numbers = [signal.SIGINT, signal.SIGTERM]
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # ignored under nohup
        numbers.append(signal.SIGHUP)
    before = {number: signal.signal(number, end) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def raise_if_ended() -> None:
    """Raises SystemExit again after a signal, because it is lost if raised in a destructor."""
    if _received:
        sys.exit(128 + _received[0])
