"""Processes that are not our children."""

import os
import select

WAIT = 60.0  # [s] longer than any end should take


def end_of(process: int) -> None:
    """Waits until a process that is not our child has ended."""
    try:
        descriptor = os.pidfd_open(process)
    except ProcessLookupError:
        return
    readable, _, _ = select.select([descriptor], [], [], WAIT)
    os.close(descriptor)
    assert readable
