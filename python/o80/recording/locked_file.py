"""A file with one writer: other processes are refused until it is closed or its process ends."""

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
        """flags: of os.open, in addition to O_RDWR. Raises OSError; BlockingIOError if locked."""
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
        """Unlocks and closes the file; may be called twice."""
        if self.descriptor >= 0:
            # forked children share the lock, if C code forked them
            with contextlib.suppress(OSError):
                fcntl.flock(self.descriptor, fcntl.LOCK_UN)
            self.leave()

    def leave(self) -> None:
        """Closes this descriptor without unlocking: the parent process keeps the lock."""
        descriptor, self.descriptor = self.descriptor, -1
        os.close(descriptor)

    def __del__(self) -> None:
        self.close()


def _leave_to_parent() -> None:
    """Closes the files in a forked child, which would keep the lock after its parent's death."""
    for file in _open_here:
        if file.descriptor >= 0:
            file.leave()
    _open_here.clear()


os.register_at_fork(after_in_child=_leave_to_parent)


KEEP_SIZE = 1  # FALLOC_FL_KEEP_SIZE: reserves blocks beyond the end, the length is unchanged


def reserve(descriptor: int, offset: int, length: int) -> None:
    """Reserves blocks of a file. Raises OSError if the disk has too few.

    Does nothing on a file system without reservation.
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
