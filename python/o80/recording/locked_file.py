"""A file that one process writes: others are refused until it is closed or its process ends."""

import contextlib
import fcntl
import os
from pathlib import Path
from weakref import WeakSet

_open_here: "WeakSet[LockedFile]" = WeakSet()


class LockedFile:
    """An open file with a lock. Closed in forked children, and when it is garbage collected."""

    descriptor = -1  #: -1: closed

    def __init__(self, path: Path, flags: int) -> None:
        """flags: of os.open, beside O_RDWR. Raises OSError, BlockingIOError if it is locked."""
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
