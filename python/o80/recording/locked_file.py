"""A file that one process writes: others are refused until it is closed or its process ends."""

import contextlib
import fcntl
import os
from pathlib import Path
from weakref import WeakSet

_open_here: "WeakSet[LockedFile]" = WeakSet()


class LockedFile:
    """An open file with a lock. Move-only: close it once; closed in forked children."""

    def __init__(self, path: Path, flags: int) -> None:
        """flags: of os.open, beside O_RDWR. Raises OSError, BlockingIOError if it is locked."""
        self.descriptor = os.open(path, os.O_RDWR | os.O_CLOEXEC | flags, 0o644)  #: -1: closed
        try:
            fcntl.flock(self.descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(self.descriptor)
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
        os.close(self.descriptor)
        self.descriptor = -1


def _leave_to_parent() -> None:
    """In a forked child, which would keep the lock when its parent is killed."""
    for file in _open_here:
        if file.descriptor >= 0:
            file.leave()
    _open_here.clear()


os.register_at_fork(after_in_child=_leave_to_parent)
