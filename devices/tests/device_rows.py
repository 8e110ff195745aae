"""Rows of a device that bursts in this process, and a server that sends fixed bytes."""

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

WAIT = 60.0  # [s] longer than anything here takes


def row_where(device: Any, condition: Callable[[Any], Any]) -> Any:
    """The sensor values of the first row that meets a condition."""
    end = time.monotonic() + WAIT
    while time.monotonic() < end:
        device.burst(1)
        row = device.latest().extended
        if condition(row):
            return row
        time.sleep(0.001)
    raise AssertionError(f"no such row within {WAIT} s; the last one: {row}")


@contextlib.contextmanager
def answering(*content: bytes) -> Iterator[int]:
    """Port of a server that sends this to its first client, and then reads until that ends."""

    def serve() -> None:
        connected, _ = listener.accept()
        with connected:
            for each in content:
                connected.sendall(each)
            connected.settimeout(WAIT)
            while connected.recv(1 << 16):
                pass

    thread = threading.Thread(target=serve)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        thread.start()
        yield listener.getsockname()[1]
        thread.join()
