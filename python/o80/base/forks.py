"""Forks while other threads import modules.

A module that another thread imports when the process is forked stays locked in the child, which
waits for ever when it imports it too. o80 imports many of its modules at their first use.
"""

import _thread
import importlib
import os
import time

LONGEST = 1.0  # [s]
LOOK = 0.001  # [s]


def _wait_for_imports() -> None:
    """Waits until other threads have finished their imports.

    At most LONGEST: one of them may wait for this thread.
    """
    end = time.monotonic() + LONGEST
    while _others_import() and time.monotonic() < end:
        time.sleep(LOOK)


def _others_import() -> bool:
    locks = getattr(importlib._bootstrap, "_module_locks", {})
    here = (None, _thread.get_ident())
    return any(getattr(lock(), "owner", None) not in here for lock in list(locks.values()))


os.register_at_fork(before=_wait_for_imports)
