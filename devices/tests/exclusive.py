"""Ports that a protocol fixes are used by one test at a time, also among processes of tests."""

import contextlib
import socket
import time
from collections.abc import Iterator

PATIENCE = 120.0  # [s]


@contextlib.contextmanager
def alone_with(what: str) -> Iterator[None]:
    end = time.monotonic() + PATIENCE
    with socket.socket(socket.AF_UNIX) as lock:
        while True:
            try:
                lock.bind(f"\0o80-test-{what}")  # in no folder: nothing is left of it
                break
            except OSError:
                assert time.monotonic() < end, f"another process of tests keeps {what}"
                time.sleep(0.05)
        yield
