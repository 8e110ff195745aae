"""Stops and halts backends in other processes."""

import contextlib
import os
import signal
import time

import o80._core as _core
from o80.base.descriptors import process_descriptor
from o80.base.errors import Error, InvalidArgument, SegmentError, TimeoutError
from o80.frontend.segments import Segment, segments

LOOK = 0.01  # [s] between checks of a backend that stops


def halt(
    segment: str,
    reason: str = "",
    timeout: float | None = 0.0,
    *wrong: object,
    **unknown: object,
) -> int:
    """Halts the backend of a segment, also one that is still starting; returns the halt's number.

    timeout: how long to wait for the backend [s]. Raises TimeoutError, SegmentError, BackendGone.
    Wrong arguments raise TypeError only after the halt.
    """
    number = _core.halt(segment, reason, timeout)
    if wrong or unknown:
        given = ", ".join([*map(repr, wrong), *unknown])
        raise TypeError(
            f"'{segment}' is halted (halt {number}), but halt() got too many arguments: {given}. "
            f"It takes segment, reason, timeout"
        )
    return number


def stop(name: str, timeout: float = 5.0) -> None:
    """Stops the backend of a segment in order: its process gets SIGTERM.

    Returns when the backend has stopped. Raises InvalidArgument if no backend of that name runs,
    SegmentError if this process may not read its segment or signal it, TimeoutError if it still
    runs after `timeout` [s].
    """
    entries = segments()
    running = {entry.name: entry for entry in entries if entry.alive}
    unseen = {entry.name: entry for entry in entries if entry.life == "unknown"}
    if name in unseen and name not in running:
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
    if not _terminate(entry):
        return
    end = time.monotonic() + timeout
    while _runs(entry):
        if time.monotonic() > end:
            raise TimeoutError(
                f"'{entry.name}' (pid {entry.pid}) did not stop in {timeout:g} s, {_why_not(entry)}"
            )
        time.sleep(LOOK)


def _why_not(entry: Segment) -> str:
    with contextlib.suppress(Error):
        if _core.backend_state(entry.name).loop.process_stopped:
            return (
                f"because its process is suspended (by Ctrl-Z, SIGSTOP or a debugger): continue it "
                f"with `kill -CONT {entry.pid}`, and it stops in order"
            )
    return f"its driver may hang: pass a longer timeout, or end it with `kill -9 {entry.pid}`"


def _terminate(entry: Segment) -> bool:
    """Sends SIGTERM to the backend's process; False if the process has ended.

    A process id may be reused, or belong to another container: the process must have started when
    the segment says. A descriptor, where there is one, refers to one process all the time.
    """
    with contextlib.ExitStack() as opened, contextlib.suppress(ProcessLookupError, ValueError):
        process = process_descriptor(entry.pid)
        if process is not None:
            opened.callback(os.close, process)
        if entry.pid > 0 and _core.process_start(entry.pid) == entry.process_start:
            if not _runs(entry):
                return False
            _signal(entry, process)
            return True
    if not _runs(entry):
        return False
    raise SegmentError(
        f"process {entry.pid} is not the one that runs '{entry.name}', which may belong to "
        f"another container: stop it there"
    )


def _signal(entry: Segment, process: int | None) -> None:
    """Sends SIGTERM. Raises ProcessLookupError; SegmentError if that is not permitted."""
    try:
        if process is not None:
            signal.pidfd_send_signal(process, signal.SIGTERM)
            return
    except ProcessLookupError:
        raise
    except (AttributeError, OSError):  # another user's, or refused by a sandbox
        pass
    try:
        os.kill(entry.pid, signal.SIGTERM)
    except ProcessLookupError:
        raise
    except OSError as error:
        raise SegmentError(
            f"'{entry.name}' (pid {entry.pid}) belongs to user {entry.user}: only that user and "
            f"root can stop it, if no sandbox refuses `kill` ({error.strerror})"
        ) from None


def _runs(entry: Segment) -> bool:
    return any(
        now.epoch == entry.epoch and now.alive for now in segments() if now.name == entry.name
    )
