"""The end of this process, and its forks.

At the end, segments, lanes and processes that are still open are closed.

If another thread imports a module during a fork, the module stays locked in the child, which waits
for ever when it imports the module, too. o80 imports many of its modules at their first use, so a
fork waits for these imports.
"""

import _thread
import atexit
import importlib
import os
import sys
import time
from types import TracebackType
from typing import Protocol, Self
from weakref import WeakKeyDictionary


class Owner(Protocol):
    """An object that is closed when the interpreter ends."""

    def _close_at_exit(self) -> None: ...


_open: WeakKeyDictionary[Owner, int] = WeakKeyDictionary()  # owner and the process that opened it
_workers: set[int] = set()  # multiprocessing workers that have the exit handler


def close_later(owner: Owner) -> None:
    """Closes `owner` at exit, unless it is closed before; the last one opened is closed first."""
    _open[owner] = os.getpid()
    _watch_worker()


def _watch_worker() -> None:
    """Registers the exit handler in a forked multiprocessing worker, which skips atexit."""
    process = sys.modules.get("multiprocessing.process")
    if process is None or process.parent_process() is None or os.getpid() in _workers:
        return
    from multiprocessing.util import Finalize

    _workers.add(os.getpid())
    Finalize(None, _close_all, exitpriority=0)


@atexit.register
def _close_all() -> None:
    for owner, process in reversed(list(_open.items())):
        if process != os.getpid():  # a forked child: the parent closes it
            continue
        try:
            owner._close_at_exit()
        except Exception:
            import traceback  # here, because o80 is imported far more often than this happens

            traceback.print_exc()  # and close the others


class Managed:
    """Ends with a `with` block."""

    def _leave(self, error: BaseException | None) -> None:
        """Ends the object after the block; error: exception that has left the block, or None."""
        raise NotImplementedError

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._leave(error)


class Closeable(Managed):
    """An object with `close`; give it to `close_later` too."""

    def close(self) -> None:
        raise NotImplementedError

    def _close_at_exit(self) -> None:
        self.close()

    def _leave(self, error: BaseException | None) -> None:
        self.close()


LONGEST = 1.0  # [s] that a fork waits for imports
LOOK = 0.001  # [s] between two checks


def _wait_for_imports() -> None:
    """Waits until other threads have finished their imports.

    Waits at most LONGEST, because such a thread may wait for this one.
    """
    end = time.monotonic() + LONGEST
    while _others_import() and time.monotonic() < end:
        time.sleep(LOOK)


def _others_import() -> bool:
    locks = getattr(importlib._bootstrap, "_module_locks", {})
    here = (None, _thread.get_ident())
    return any(getattr(lock(), "owner", None) not in here for lock in list(locks.values()))


os.register_at_fork(before=_wait_for_imports)
