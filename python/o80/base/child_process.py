"""Child processes that end when their standard input ends, and so with this process."""

import contextlib
import math
import os
import select
import signal
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from weakref import WeakSet

from o80.base.descriptors import above_standard, process_descriptor

COLLECT = 1.0  # [s] for the exit code of a process that has ended
POLL = 0.01  # [s] between checks of a process that has no descriptor


class _Child(subprocess.Popen[bytes]):
    """A child that ends when it is garbage collected, for example after an early Ctrl-C."""

    def __del__(self) -> None:
        # Popen keeps a lost process that runs, and its pipes with it
        pipe = getattr(self, "stdin", None)
        if pipe is not None:
            with contextlib.suppress(OSError):
                pipe.close()
        super().__del__()


_children: WeakSet[subprocess.Popen[bytes]] = WeakSet()
_signalled: WeakSet[subprocess.Popen[bytes]] = WeakSet()


def start_child(command: Sequence[str | Path], **options: Any) -> subprocess.Popen[bytes]:
    """Starts a program that ends at the end of its standard input. options: of Popen.

    A forked child of this process closes the program's pipes, so that it ends with the parent.
    """
    # A process group of its own: Ctrl-C reaches only this program, which ends the child in order.
    # Not a session of its own: the kernel divides processor time between sessions first, so a robot
    # alone would get as much as all programs that read it.
    with above_standard():
        child = _Child(command, stdin=subprocess.PIPE, process_group=0, **options)
    _children.add(child)
    return child


def ends_within(child: subprocess.Popen[bytes], timeout: float | None) -> bool:
    """True if the child ends within `timeout`. Ctrl-C ends this wait at once, unlike Popen.wait."""
    if child.poll() is not None:
        return True
    try:
        life = process_descriptor(child.pid)
    except ProcessLookupError:  # another thread has collected its exit code meanwhile
        return True
    if life is not None:
        try:
            end = select.poll()
            end.register(life, select.POLLIN)
            return bool(end.poll(None if timeout is None else min(max(timeout, 0.0), 1e6) * 1e3))
        except OSError:  # refused
            pass
        finally:
            os.close(life)
    latest = math.inf if timeout is None else time.monotonic() + timeout
    while child.poll() is None and time.monotonic() < latest:
        time.sleep(POLL)
    return child.returncode is not None


def end_child(
    child: subprocess.Popen[bytes], grace: float, also: signal.Signals | None = None
) -> None:
    """Sends a signal `also`, ends the child's standard input, and kills it after `grace` [s]."""
    # once, and before the input ends: a child that is ending has no handler any more
    if also is not None and child not in _signalled:
        _signalled.add(child)
        with contextlib.suppress(OSError):  # refused: the end of the child's input ends it, too
            child.send_signal(also)
    if child.stdin is not None:
        with contextlib.suppress(OSError):
            child.stdin.close()
    if not ends_within(child, grace):
        child.kill()
    # an interrupt inside Popen may have left its lock taken; OSError: wait4 is refused
    with contextlib.suppress(subprocess.TimeoutExpired, OSError):
        child.wait(COLLECT)


def _leave_to_parent() -> None:
    """Closes the inherited pipes: else children of a killed parent would run as long as this."""
    for child in list(_children):
        for pipe in (child.stdin, child.stdout):
            if pipe is not None:
                pipe.close()
        child.returncode = 0
    _children.clear()


os.register_at_fork(after_in_child=_leave_to_parent)
