"""What was not closed when the interpreter ends is closed then: segments, lanes, processes."""

import atexit
import os
import sys
import traceback
from typing import Protocol
from weakref import WeakKeyDictionary


class Owner(Protocol):
    """Whatever is to be given back."""

    def _close_at_exit(self) -> None: ...


_open: WeakKeyDictionary[Owner, int] = WeakKeyDictionary()  # and the process it lives in
_workers: set[int] = set()  # processes of multiprocessing whose end is watched


def close_later(owner: Owner) -> None:
    """Closes it at the end, unless that was done before; what was opened last is closed first."""
    _open[owner] = os.getpid()
    _watch_worker()


def _watch_worker() -> None:
    """A forked worker of multiprocessing leaves without asking atexit."""
    process = sys.modules.get("multiprocessing.process")
    if process is None or process.parent_process() is None or os.getpid() in _workers:
        return
    from multiprocessing.util import Finalize

    _workers.add(os.getpid())
    Finalize(None, _close_all, exitpriority=0)


@atexit.register
def _close_all() -> None:
    for owner, process in reversed(list(_open.items())):
        if process != os.getpid():  # a forked child leaves it to its parent
            continue
        try:
            owner._close_at_exit()
        except Exception:
            traceback.print_exc()  # the others are closed all the same
