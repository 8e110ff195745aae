"""Stops and halts backends in other processes."""

import contextlib
import os
import signal
import time
from collections.abc import Iterator

import o80._core as _core
from o80.base.errors import InvalidArgument, SegmentError, TimeoutError
from o80.frontend.segments import Segment, segments

LOOK = 0.01  # [s] between checks of a backend that stops


def halt(segment: str, reason: str = "", timeout: float | None = 0.0) -> int:
    """Halts the backend of a segment, also one that is still starting; returns the halt's number.

    timeout: how long to wait for the backend [s]. Raises TimeoutError, SegmentError, BackendGone.
    """
    return _core.halt(segment, reason, timeout)


def stop(name: str, timeout: float = 5.0) -> None:
    """Stops the backend of a segment in order: its process gets SIGTERM.

    Returns when the backend has stopped. Raises InvalidArgument if no backend of that name runs,
    SegmentError if this process may not read its segment or signal it, TimeoutError if it still
    runs after `timeout` [s].
    """
    entries = segments()
    running = {entry.name: entry for entry in entries if entry.alive}
    unseen = {entry.name: entry for entry in entries if entry.life == "unknown"}
    if name in unseen:
        raise SegmentError(
            f"it is unknown whether '{name}' of user {unseen[name].user} runs: "
            f"{unseen[name].problem}. Its user and root can stop it"
        )
    if not entries and (problem := _core.directory_problem()):
        raise SegmentError(problem)
    if name not in running:
        there = "; nothing that this user can see runs" if unseen else "; nothing runs"
        if running:
            there = _core.names_instead(name, list(running)).replace("there are", "running")
        raise InvalidArgument(f"no backend '{name}' runs{there}")
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
