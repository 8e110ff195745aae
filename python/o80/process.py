"""A robot that runs as a process of its own."""

import contextlib
import signal
import subprocess
import tempfile
import time
import warnings
from collections.abc import Sequence
from types import TracebackType
from typing import IO, Any, Self

from o80 import _core
from o80.errors import DriverError, Error, InvalidArgument, SegmentTaken, TimeoutError
from o80.frontend import Frontend
from o80.installation import prefix

GRACE = 5.0  # [s] for a robot to stop
LOOK = 0.002  # [s] between looks at a robot that starts
BAD_OPTIONS = 2  # exit code


class Process:
    """A robot's process. Leaving a `with` block stops it; it also ends when this process does."""

    def __init__(self, popen: subprocess.Popen[bytes], segment: str, output: IO[bytes]) -> None:
        self._popen = popen
        self._output = output
        self.segment = segment  #: the name to attach to

    @property
    def pid(self) -> int:
        """Of the process."""
        return self._popen.pid

    @property
    def alive(self) -> bool:
        """Whether it runs."""
        return self._popen.poll() is None

    @property
    def output(self) -> str:
        """All that it printed so far."""
        self._output.seek(0)
        return self._output.read().decode(errors="replace")

    def frontend(self, timeout: float | None = 5.0, **options: Any) -> Frontend:
        """A frontend of it; takes what Frontend takes."""
        return Frontend(self.segment, timeout, **options)

    def wait(self, timeout: float | None = None) -> int:
        """Waits for its end and gives the exit code: 0 if it ended in order.

        Raises TimeoutError after `timeout` [s].
        """
        try:
            return self._popen.wait(timeout)
        except subprocess.TimeoutExpired:
            raise TimeoutError(f"the robot of '{self.segment}' still runs") from None

    def stop(self, timeout: float = GRACE) -> None:
        """Stops it in order; after `timeout` [s] it is killed."""
        if self._popen.stdin is not None:
            with contextlib.suppress(OSError):
                self._popen.stdin.close()
        try:
            if self.alive:
                self._popen.send_signal(signal.SIGTERM)
            self._popen.wait(timeout)
        except subprocess.TimeoutExpired:
            self._popen.kill()
            self._popen.wait()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()

    def __del__(self) -> None:
        if self.alive:
            warnings.warn(
                f"the robot of '{self.segment}' was never stopped", ResourceWarning, stacklevel=2
            )
            self.stop()
        self._output.close()

    def __repr__(self) -> str:
        state = f"pid {self.pid}" if self.alive else f"ended with {self._popen.returncode}"
        return f"<o80.robots.Process of '{self.segment}', {state}>"


def start_process(
    library: str, segment: str, flags: Sequence[str], timeout: float | None
) -> Process:
    """Starts a robot library in a process and waits until it runs."""
    output = tempfile.TemporaryFile()  # noqa: SIM115, it lives as long as the process
    popen = subprocess.Popen(
        [prefix() / "bin" / "o80-run", library, f"--segment={segment}", "--until-eof", *flags],
        stdin=subprocess.PIPE,
        stdout=output,
        stderr=subprocess.STDOUT,
        start_new_session=True,  # Ctrl-C is for the program; it stops the robot in order
    )
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


def _wait_until_running(process: Process, timeout: float | None) -> None:
    end = None if timeout is None else time.monotonic() + timeout
    while not _runs(process):
        if not process.alive:
            raise _why_it_ended(process)
        if end is not None and time.monotonic() > end:
            raise TimeoutError(
                f"the robot of '{process.segment}' was not running after {timeout} s: give it "
                f"more time, or see what it printed:\n{process.output}"
            )
        time.sleep(LOOK)


def _runs(process: Process) -> bool:
    return any(
        entry.name == process.segment and entry.pid == process.pid and entry.life == "running"
        for entry in _core.list_segments()
    )


def _why_it_ended(process: Process) -> Error:
    code = process.wait()
    # what o80 says last, without what the driver printed before
    text = process.output.strip().rpartition("\no80: ")[2].removeprefix("o80: ")
    text = text or f"it ended with exit code {code}"
    if code == BAD_OPTIONS:
        return InvalidArgument(text)
    if "already has a backend" in text:
        return SegmentTaken(text)
    return DriverError(text)
