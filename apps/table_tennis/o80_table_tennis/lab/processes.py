"""Starts and ends the processes of the lab, and says which of them has ended and why.

The processes know nothing of each other's start: each waits by itself for what it needs. They end
in order when the supervisor does, in whatever way: a signal of the kernel tells them
(PR_SET_PDEATHSIG), so that a supervisor that is killed leaves nothing.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import o80
from o80.base.child_process import end_child
from o80.base.lifecycle import Closeable

from .parts import Part

LOOK = 0.05
"""Between two looks whether a process has ended, or runs [s]."""
GRACE = 5.0
"""For a process to end in order; then it is killed [s]."""
LAST_LINES = 8
"""Number of the last lines of its output, which say why a process has ended."""
PR_SET_PDEATHSIG = 1
_libc = ctypes.CDLL(None, use_errno=True)


class PartEndedError(RuntimeError):
    """A process has ended that nobody had asked to."""

    def __init__(self, part: str, code: int, lines: Sequence[str]) -> None:
        self.part, self.code, self.lines = part, code, tuple(lines)
        how = f"ended with exit code {code}"
        if code < 0:
            with contextlib.suppress(ValueError):
                how = f"was killed by {signal.Signals(-code).name}"
        told = "".join(f"\n  {line}" for line in lines) or "\n  (it printed nothing)"
        super().__init__(f"the process '{part}' {how}. It printed last:{told}")


class Processes(Closeable):
    """The processes of the lab. Leaving a `with` block ends all.

    Start processes from the main thread: the kernel takes the end of the thread that started a
    process for that of the whole supervisor.

    folder: where each process has a file of what it prints.
    """

    def __init__(self, parts: Iterable[Part], folder: Path) -> None:
        self.parts: dict[str, Part] = {part.name: part for part in parts}
        self._folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, names: Iterable[str] | None = None) -> None:
        """Starts processes, in this order, without waiting; None: all. See `wait_until_running`."""
        for name in self.parts if names is None else names:
            with self._output_of(name).open("ab") as output:
                self._running[name] = subprocess.Popen(
                    self.parts[name].command,
                    stdin=subprocess.DEVNULL,
                    stdout=output,
                    stderr=subprocess.STDOUT,
                    # Ctrl-C reaches only the supervisor, which ends the others in order
                    process_group=0,
                    preexec_fn=_ends_with(os.getpid()),
                )

    def wait_until_running(self, timeout: float) -> None:
        """Waits for the segments, or the words, of all processes that were started.

        Raises PartEndedError if one ends meanwhile, o80.TimeoutError with those that do not run.
        """
        end = time.monotonic() + timeout
        missing = list(self._running)
        while missing := [name for name in missing if not self.runs(name)]:
            if time.monotonic() > end:
                lines = [f"'{name}': {' / '.join(self._last_lines(name))}" for name in missing]
                raise o80.TimeoutError(
                    f"after {timeout:g} s these processes do not run yet:\n" + "\n".join(lines)
                )
            for name in self.ended(LOOK):
                raise self.collected(name)

    def runs(self, name: str) -> bool:
        """Whether a process is there and has begun its work."""
        popen, part = self._running.get(name), self.parts[name]
        if popen is None or popen.poll() is not None:
            return False
        if part.segment is None:
            return part.says is None or part.says in self.printed(name)
        return any(
            each.name == part.segment and each.pid == popen.pid and each.life == "running"
            for each in o80.segments()
        )

    def ended(self, timeout: float = 0.0) -> list[str]:
        """The processes that have ended and were not collected; waits for one at most so long."""
        end = time.monotonic() + timeout
        while True:
            found = [name for name, popen in self._running.items() if popen.poll() is not None]
            if found or time.monotonic() >= end:
                return found
            time.sleep(LOOK)

    def collected(self, name: str) -> PartEndedError:
        """Takes a process that has ended off the list, and tells how; it may be started again."""
        code = self._running.pop(name).wait()
        return PartEndedError(name, code, self._last_lines(name))

    def pid(self, name: str) -> int:
        """Process id of a process that runs. Raises KeyError."""
        return self._running[name].pid

    @property
    def running(self) -> list[str]:
        """Names of the processes that were started and have not been collected."""
        return list(self._running)

    def printed(self, name: str) -> str:
        """Output of a process, over all its starts."""
        with contextlib.suppress(FileNotFoundError):
            return self._output_of(name).read_text(errors="replace")
        return ""

    def _last_lines(self, name: str) -> list[str]:
        return self.printed(name).rstrip().splitlines()[-LAST_LINES:]

    def _output_of(self, name: str) -> Path:
        return self._folder / f"{name}.txt"

    def close(self) -> None:
        """Ends all, the last of the table first, and removes the segments of those killed."""
        try:
            for name in reversed(self.parts):
                if name in self._running:
                    end_child(self._running[name], GRACE, signal.SIGTERM)
                    del self._running[name]
        finally:
            for popen in self._running.values():
                end_child(popen, 0.0)
            self._running.clear()
            for part in self.parts.values():
                if part.segment is not None:
                    with contextlib.suppress(o80.Error):
                        o80.clean(part.segment)


def _ends_with(supervisor: int) -> Callable[[], None]:
    """First call of a new process: asks the kernel for SIGTERM when the supervisor dies."""

    def ask() -> None:
        _libc.prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
        if os.getppid() != supervisor:  # it died before the kernel was asked
            os._exit(1)

    return ask
