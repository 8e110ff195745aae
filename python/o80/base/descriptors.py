"""Descriptors from 3 on: prints must not go into a file that got descriptor 0, 1 or 2."""

import contextlib
import errno
import os
import sys
import threading
from collections.abc import Iterator


def open_standard_streams() -> None:
    """Opens /dev/null on closed ones of descriptors 0, 1, 2; the first call of a program."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError as error:
            if error.errno == errno.EBADF:
                _open_null(number)
        if getattr(sys, name) is None:
            with contextlib.suppress(OSError):
                setattr(sys, name, os.fdopen(number, "w" if number else "r", encoding="utf-8"))


def _open_null(number: int) -> None:
    with contextlib.suppress(OSError):  # a root without /dev
        opened = os.open(os.devnull, os.O_WRONLY if number else os.O_RDONLY)
        os.set_inheritable(opened, opened == number)  # by programs that this one starts
        if opened != number:  # another thread has taken the number
            os.close(opened)


_lock = threading.Lock()
_users = 0
_held: list[int] = []
# a fork waits for the lock, so that it is free in the child
os.register_at_fork(
    before=_lock.acquire, after_in_parent=_lock.release, after_in_child=_lock.release
)


@contextlib.contextmanager
def above_standard() -> Iterator[None]:
    """Makes files that are opened in its block get descriptors from 3 on; for files that stay open.

    A host program may have been started without 0, 1, 2; it prints to them nevertheless, and finds
    them closed as before.
    """
    global _users
    with _lock:
        if _users == 0:
            _hold()
        _users += 1
    try:
        yield
    finally:
        with _lock:
            _users -= 1
            while _users == 0 and _held:
                os.close(_held.pop())


def _hold() -> None:
    with contextlib.suppress(OSError):
        while (number := os.open(os.devnull, os.O_RDONLY)) <= 2:
            _held.append(number)
        os.close(number)


def process_descriptor(pid: int) -> int | None:
    """Opens a pidfd; None if that is refused (gVisor, container profiles, some builds of Python).

    Raises ProcessLookupError if there is no such process.
    """
    try:
        with above_standard():
            return os.pidfd_open(pid)
    except ProcessLookupError:
        raise
    except (AttributeError, OSError):
        return None
