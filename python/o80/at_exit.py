"""What owns a segment gives it back when the interpreter ends, even if nobody closed it."""

import atexit
import os
from typing import Protocol
from weakref import WeakKeyDictionary


class Closable(Protocol):
    """Whatever can be closed."""

    def close(self) -> None: ...


_open: WeakKeyDictionary[Closable, int] = WeakKeyDictionary()  # and the process it lives in


def close_later(owner: Closable) -> None:
    """Closes it at the end, unless that was done before."""
    _open[owner] = os.getpid()


@atexit.register
def _close_all() -> None:
    for owner, process in list(_open.items()):
        if process == os.getpid():  # not in a forked child
            owner.close()
