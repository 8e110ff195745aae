"""Interrupts at every moment at which Python can raise one."""

import itertools
import sys
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any


def interrupted(block: Callable[[], object], moment: int) -> KeyboardInterrupt | None:
    """Calls it, interrupted before its instruction of that number; None if it ended before."""
    left = moment

    def trace(frame: FrameType, event: str, _: object) -> Any:
        nonlocal left
        frame.f_trace_opcodes = True
        left -= event == "opcode"
        if left == 0:
            raise KeyboardInterrupt
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        block()
    except KeyboardInterrupt as error:
        return error
    finally:
        sys.settrace(before)
    return None


def at_every_moment(block: Callable[[], object]) -> Iterator[KeyboardInterrupt]:
    """The interrupts of calls of it, each interrupted one instruction later than the last."""
    for moment in itertools.count(1):
        if (error := interrupted(block, moment)) is None:
            return
        yield error
