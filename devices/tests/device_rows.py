"""Rows of a device that is burst in this process."""

import time
from collections.abc import Callable
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
