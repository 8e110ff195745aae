"""A file that one process writes: others are refused until it is closed or its process ends."""

import contextlib
import ctypes
import errno
import fcntl
import os
from functools import lru_cache
from pathlib import Path
from typing import Any
from weakref import WeakSet

from o80.base.descriptors import above_standard

_open_here: "WeakSet[LockedFile]" = WeakSet()


class LockedFile:
    """An open file with a lock. Closed in forked children, and when it is garbage collected."""

    descriptor = -1  #: -1: closed

    def __init__(self, path: Path, flags: int) -> None:
        """flags: of os.open, beside O_RDWR. Raises OSError, BlockingIOError if it is locked."""
        with above_standard():
            self.descriptor = os.open(path, os.O_RDWR | os.O_CLOEXEC | flags, 0o644)
        try:
            fcntl.flock(self.descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self.leave()
            raise
        except OSError:  # a file system without locks
            pass
        _open_here.add(self)

    def close(self) -> None:
        """May be called twice."""
        if self.descriptor >= 0:
            # children that were forked in C share the lock
            with contextlib.suppress(OSError):
                fcntl.flock(self.descriptor, fcntl.LOCK_UN)
            self.leave()

    def leave(self) -> None:
        """Closes this descriptor and leaves the lock to that of the parent process."""
        descriptor, self.descriptor = self.descriptor, -1
        os.close(descriptor)

    def __del__(self) -> None:
        self.close()


def _leave_to_parent() -> None:
    """In a forked child, which would keep the lock when its parent is killed."""
    for file in _open_here:
        if file.descriptor >= 0:
            file.leave()
    _open_here.clear()


os.register_at_fork(after_in_child=_leave_to_parent)


KEEP_SIZE = 1  # FALLOC_FL_KEEP_SIZE: blocks beyond the end of the file, whose length stays


def reserve(descriptor: int, offset: int, length: int) -> None:
    """Reserves blocks of a file. Raises OSError if there are not so many.

    A file system that cannot do this is left as it is.
    """
    if _fallocate()(descriptor, KEEP_SIZE, offset, length) == 0:
        return
    number = ctypes.get_errno()
    if number not in (errno.EOPNOTSUPP, errno.ENOSYS):
        raise OSError(number, os.strerror(number))


@lru_cache(maxsize=1)
def _fallocate() -> Any:
    function = ctypes.CDLL(None, use_errno=True).fallocate
    function.argtypes = [ctypes.c_int, ctypes.c_int, ctypes.c_int64, ctypes.c_int64]
    return function
