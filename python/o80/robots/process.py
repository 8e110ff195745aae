"""Starts a robot in a process of its own, and stops it."""

import os
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any

import o80._core as _core
from o80.base import lifecycle
from o80.base.child_process import end_child, ends_within, start_child
from o80.base.descriptors import above_standard
from o80.base.errors import (
    DriverError,
    Error,
    InvalidArgument,
    SegmentTaken,
    TimeoutError,
    UsedAfterFork,
)
from o80.frontend.frontend import Frontend

GRACE = 5.0  # [s] for a robot to stop
LOOK = 0.002  # [s] between checks of a robot that starts
BAD_OPTIONS = 2  # exit code


class Process(lifecycle.Managed):
    """A robot's process. Leaving a `with` block stops it; it also ends when this process does.

    The robot stops in order when this process ends in any way, also by a kill. Start a robot with
    `o80 run` if it must continue. Garbage collection stops a running robot with a ResourceWarning.
    May be used from several threads; a forked child may call only `frontend`.
    """

    _owner = 0  # an interrupt may come before it is set

    def __init__(self, popen: subprocess.Popen[bytes], segment: str, output: IO[bytes]) -> None:
        self._popen = popen
        self._output = output
        self.segment = segment  #: name of its segment
        self._owner = os.getpid()
        lifecycle.close_later(self)

    @property
    def pid(self) -> int:
        """The process id."""
        return self._own.pid

    @property
    def alive(self) -> bool:
        """True while the process runs."""
        return self._own.poll() is None

    @property
    def output(self) -> str:
        """Everything that the process has printed so far."""
        self._check_process()
        printed = self._output.fileno()
        text = b""
        # pread, not seek: the robot writes at the position of this open file
        while part := os.pread(printed, 1 << 16, len(text)):
            text += part
        return text.decode(errors="replace")

    def frontend(
        self, timeout: float | None = 5.0, *, real_time: bool = False, **options: Any
    ) -> Frontend:
        """Attaches a frontend to the robot; takes the arguments of Frontend.

        real_time: give the calling thread the policy fifo, one priority below the loop's, so that
            busy programs do not delay its waits. After 200 ms without sleep it becomes an ordinary
            thread again and reports this on the standard error. If the loop has no real-time
            priority, or the machine refuses, a RuntimeWarning reports this. Threads and programs
            that it starts are ordinary.
        """
        frontend = Frontend(self.segment, timeout, **options)
        if real_time:
            priority = os.sched_getparam(self._popen.pid).sched_priority - 1
            if priority < 1:
                why = "the loop has no real-time priority above 1: start it with policy='fifo'"
            elif not _core.become_real_time(priority):
                why = f"priority {priority} was refused: see docs/real_time/machine.md"
            else:
                return frontend
            warnings.warn(f"this thread stays an ordinary one: {why}", RuntimeWarning, stacklevel=2)
        return frontend

    def wait(self, timeout: float | None = None) -> int:
        """Waits until the process ends and returns its exit code: 0 for an end in order.

        Raises TimeoutError after `timeout` [s].
        """
        if not ends_within(self._own, timeout):
            raise TimeoutError(
                f"the robot of '{self.segment}' did not end within {timeout} s: stop() ends it"
            )
        return self._popen.wait()

    def stop(self, timeout: float = GRACE) -> None:
        """Stops the robot in order; kills it after `timeout` [s].

        A `wait` in another thread returns.
        """
        end_child(self._own, timeout, signal.SIGTERM)

    def _check_process(self) -> None:
        if self._owner != os.getpid():
            raise UsedAfterFork(
                f"the robot of '{self.segment}' was started by the parent of this process, which "
                f"alone can stop it; attach to it by o80.Frontend({self.segment!r})"
            )

    @property
    def _own(self) -> subprocess.Popen[bytes]:
        self._check_process()
        return self._popen

    def _close_at_exit(self) -> None:
        self.stop()

    def _leave(self, error: BaseException | None) -> None:
        if self._owner == os.getpid():
            self.stop()

    def __del__(self) -> None:
        if self._owner == 0:
            return
        if self._owner == os.getpid() and self.alive:
            warnings.warn(
                f"the robot of '{self.segment}' was never stopped", ResourceWarning, stacklevel=2
            )
            self.stop()
        self._output.close()

    def __reduce__(self) -> tuple[Any, ...]:
        raise TypeError(
            f"a robot's process cannot be pickled: send its segment's name, and open "
            f"o80.Frontend({self.segment!r}) there"
        )

    def __repr__(self) -> str:
        if self._owner != os.getpid():
            state = "of the parent process"
        elif self.alive:
            state = f"pid {self.pid}"
        else:
            state = f"ended with {self._popen.returncode}"
        return f"<o80.robots.Process of '{self.segment}', {state}>"


def start_process(
    program: Sequence[str | Path],
    segment: str,
    flags: Sequence[str],
    timeout: float | None,
    environment: Mapping[str, str] | None = None,
) -> Process:
    """Starts a robot's program and waits until it runs. environment: None: this process's."""
    import tempfile  # here, because it takes a tenth of the time to import o80

    _refuse_in_import()
    with above_standard():
        output = tempfile.TemporaryFile()  # noqa: SIM115, it lives as long as the process
    try:
        popen = start_child(
            [*program, f"--segment={segment}", "--until-eof", *flags],
            env=environment,
            stdout=output,
            stderr=subprocess.STDOUT,
        )
    except BaseException:
        output.close()
        raise
    process = Process(popen, segment, output)
    try:
        _wait_until_running(process, timeout)
    except BaseException:
        process.stop()
        raise
    for line in process.output.splitlines():
        if line.startswith("o80: "):
            warnings.warn(f"'{segment}': {line[5:]}", RuntimeWarning, stacklevel=3)
    return process


def _refuse_in_import() -> None:
    """Refuses to start a robot from a script that a robot's process imports to find its class."""
    drivers = sys.modules.get("o80.drivers.driver_class")
    if drivers is not None and drivers.imported_to_run:
        file = drivers.imported_to_run.rpartition(":")[0]
        raise DriverError(
            f"{file} starts a robot when it is imported, and the robot's process imports it to "
            f'find the class: put what the script does under `if __name__ == "__main__":`'
        )


def _wait_until_running(process: Process, timeout: float | None) -> None:
    end = None if timeout is None else time.monotonic() + timeout
    while not _runs(process):
        if not process.alive:
            raise _why_it_ended(process)
        if end is not None and time.monotonic() > end:
            raise TimeoutError(
                f"the robot of '{process.segment}' was not running after {timeout} s: pass a "
                f"longer timeout, or read what it printed:\n{process.output}"
            )
        time.sleep(LOOK)


def _runs(process: Process) -> bool:
    return any(
        entry.name == process.segment and entry.pid == process.pid and entry.life == "running"
        for entry in _core.list_segments()
    )


def _why_it_ended(process: Process) -> Error:
    code = process.wait()
    # the last message of o80, without the output of the driver before it
    text = process.output.strip().rpartition("\no80: ")[2].removeprefix("o80: ")
    text = text or f"it ended with exit code {code}"
    if code == BAD_OPTIONS:
        return InvalidArgument(text)
    if "already has a backend" in text:
        return SegmentTaken(text)
    return DriverError(text)
