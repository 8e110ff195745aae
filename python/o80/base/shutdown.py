"""Closes segments, lanes and processes that are still open when the interpreter ends."""

import atexit
import os
import sys
from typing import Protocol
from weakref import WeakKeyDictionary


class Owner(Protocol):
    """An object that is closed when the interpreter ends."""

    def _close_at_exit(self) -> None: ...


_open: WeakKeyDictionary[Owner, int] = WeakKeyDictionary()  # with the process that opened it
_workers: set[int] = set()  # multiprocessing workers that have the exit handler


def close_later(owner: Owner) -> None:
    """Closes `owner` at exit, unless it is closed before. The last one opened is closed first."""
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
