"""Stops backends in other processes."""

import contextlib
import os
import signal
import time
from collections.abc import Iterator

from o80 import _core
from o80.errors import InvalidArgument, SegmentError, TimeoutError
from o80.segment_list import Segment, segments

LOOK = 0.01  # [s] between checks of a backend that stops


def stop(name: str, timeout: float = 5.0) -> None:
    """Stops the backend of a segment in order: its process gets SIGTERM.

    Returns when the backend has stopped. Raises InvalidArgument if no backend of that name runs,
    SegmentError if this process may not signal it, TimeoutError if it still runs after `timeout`
    [s].
    """
    running = {entry.name: entry for entry in segments() if entry.alive}
    if name not in running:
        there = _core.names_instead(name, list(running)) if running else "; nothing runs"
        raise InvalidArgument(f"no backend '{name}' runs{there.replace('there are', 'running')}")
    stop_entry(running[name], timeout)


def stop_entry(entry: Segment, timeout: float) -> None:
    """Stops one run of a backend; does nothing if that run has ended."""
    with _process_of(entry) as process:
        if process is None or not _runs(entry):
            return
        try:
            signal.pidfd_send_signal(process, signal.SIGTERM)
        except ProcessLookupError:
            return
        except PermissionError:
            raise SegmentError(
                f"'{entry.name}' (pid {entry.pid}) belongs to user {entry.user}: only that user "
                f"and root may stop it"
            ) from None
    end = time.monotonic() + timeout
    while _runs(entry):
        if time.monotonic() > end:
            raise TimeoutError(
                f"'{entry.name}' (pid {entry.pid}) did not stop in {timeout:g} s, its driver may "
                f"hang: pass a longer timeout, or end it with `kill -9 {entry.pid}`"
            )
        time.sleep(LOOK)


@contextlib.contextmanager
def _process_of(entry: Segment) -> Iterator[int | None]:
    """A descriptor of the backend's process, or None if the process has ended.

    A process id may be reused, or belong to another container. A descriptor refers to one process;
    it is used only if the start time of that process is the one in the segment.
    """
    try:
        process = os.pidfd_open(entry.pid)
    except (ProcessLookupError, ValueError):
        process = None
    try:
        if process is not None and _core.process_start(entry.pid) == entry.process_start:
            yield process
        elif not _runs(entry):
            yield None
        else:
            raise SegmentError(
                f"process {entry.pid} is not the one that runs '{entry.name}', which may belong to "
                f"another container: stop it there"
            )
    finally:
        if process is not None:
            os.close(process)


def _runs(entry: Segment) -> bool:
    return any(
        now.epoch == entry.epoch and now.alive for now in segments() if now.name == entry.name
    )
