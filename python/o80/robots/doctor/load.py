"""Load during a measurement of the doctor: every processor computes and moves memory."""

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from o80.base.child_process import end_child, start_child
from o80.base.descriptors import open_standard_streams

BYTES = 8 << 20  # more than most caches hold; a thread copies from one such array to another
GRACE = 5.0  # [s] for the load to end


@contextmanager
def load() -> Iterator[int]:
    """Runs a busy thread for each processor; yields the process id. Raises OSError if it fails."""
    child = start_child([sys.executable, "-m", __name__], stdout=subprocess.PIPE)
    try:
        assert child.stdout is not None
        if not child.stdout.readline():
            raise OSError("the load could not be started")
        yield child.pid
    finally:
        end_child(child, GRACE)


def _copy() -> None:
    import numpy as np

    source, target = np.ones(BYTES, np.uint8), np.zeros(BYTES, np.uint8)
    while True:
        np.copyto(target, source)  # without Python's lock, so all threads at once


def _run() -> None:
    """Computes until the end of the standard input."""
    for _ in os.sched_getaffinity(0):
        threading.Thread(target=_copy, daemon=True).start()
    print("loaded", flush=True)
    sys.stdin.read()


if __name__ == "__main__":
    open_standard_streams()
    _run()
