"""Interrupts a call at every moment at which Python can raise one."""

import dis
import itertools
import sys
import threading
from collections.abc import Callable, Iterator
from functools import cache
from types import CodeType, FrameType
from typing import Any


@cache
def moments_of(code: CodeType) -> frozenset[int]:
    """Offsets before which Python checks for signals: after a call, at the begin of a loop.

    Elsewhere an interrupt can cause states that a signal cannot, such as an exception that stays
    handled.
    """
    looked = set()
    after = False
    for each in dis.get_instructions(code):
        if after:
            looked.add(each.offset)
        after = each.opname.startswith("CALL") or each.opname == "RESUME"
        if "JUMP_BACKWARD" in each.opname:
            looked.add(each.argval)
    return frozenset(looked)


def interrupted(block: Callable[[], object], moment: int) -> BaseException | None:
    """Calls `block` with an interrupt at this moment; returns the error, None if it ended before.

    Python's modules may raise another exception instead, for example of an unlocked lock.
    `threading` is left out: between the last instruction of a `with` and its end, where no signal
    is handled, an interrupt would leave the lock of all threads taken.
    """
    left = moment

    def trace(frame: FrameType, event: str, _: object) -> Any:
        nonlocal left
        frame.f_trace_opcodes = frame.f_code.co_filename != threading.__file__
        left -= event == "opcode" and frame.f_lasti in moments_of(frame.f_code)
        if left == 0:
            raise KeyboardInterrupt
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        block()
    except BaseException as error:
        if left > 0:
            raise
        return error
    finally:
        sys.settrace(before)
    return None


def at_every_moment(block: Callable[[], object], step: int = 1) -> Iterator[BaseException | None]:
    """Calls `block` again and again, each time interrupted `step` moments later."""
    block()  # a first call imports all: an interrupted import would leave its lock taken
    for moment in itertools.count(1, step):
        errors = [interrupted(block, moment)]  # a variable would keep the exception
        if errors[0] is None:
            return
        yield errors.pop()
