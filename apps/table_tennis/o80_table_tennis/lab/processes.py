"""Starts and ends the processes of the lab, and reports ended ones with the reason.

The processes also end when the supervisor is killed: the kernel then sends them a signal
(PR_SET_PDEATHSIG).
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import subprocess
import time
from collections.abc import Iterable
from pathlib import Path

import o80
from o80.base.child_process import end_child
from o80.base.lifecycle import Closeable
from o80_devices.attached import Attached

from .parts import Part

POLL = 0.05
"""Interval of polling the processes [s]."""
GRACE = 5.0
"""Timeout of a clean end; then the process is killed [s]."""
SILENT = 0.1
"""Age of the newest row above which a segment that does not burst counts as missing [s]."""
LAST_LINES = 8
"""Number of the last lines of output that are shown for an ended process."""
PR_SET_PDEATHSIG = 1
_libc = ctypes.CDLL(None, use_errno=True)


class PartEndedError(RuntimeError):
    """A process has ended without a request."""

    def __init__(self, part: str, code: int, lines: list[str]) -> None:
        self.code, self.lines = code, lines
        how = f"ended with exit code {code}"
        if -code in set(signal.Signals):
            how = f"was killed by {signal.Signals(-code).name}"
        told = "".join(f"\n  {line}" for line in lines or ["(it printed nothing)"])
        super().__init__(f"the process '{part}' {how}. It printed last:{told}")


class Processes(Closeable):
    """Processes of the lab. Leaving a `with` block ends all.

    Start them in the main thread: the kernel takes the end of the starting thread for the parent's.
    """

    def __init__(self, parts: Iterable[Part], folder: Path) -> None:
        """folder: for a file of each process's output."""
        self.parts: dict[str, Part] = {part.name: part for part in parts}
        self.running: dict[str, subprocess.Popen[bytes]] = {}
        """Started processes that have not been collected."""
        self._folder = folder
        folder.mkdir(parents=True, exist_ok=True)

    def start(self, *names: str) -> None:
        """Starts processes in this order, all if none is named, without waiting."""
        supervisor = os.getpid()

        def end_with_it() -> None:
            _libc.prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
            if os.getppid() != supervisor:  # the supervisor died before prctl
                os._exit(1)

        for name in names or self.parts:
            with (self._folder / f"{name}.txt").open("ab") as output:
                self.running[name] = subprocess.Popen(
                    self.parts[name].command,
                    stdin=subprocess.DEVNULL,
                    stdout=output,
                    stderr=subprocess.STDOUT,
                    # Ctrl-C reaches only the supervisor, which ends the others in order
                    process_group=0,
                    preexec_fn=end_with_it,
                )

    def wait_until_running(self, timeout: float) -> None:
        """Waits until all started processes are running.

        Raises PartEndedError if one ends meanwhile, o80.TimeoutError naming the missing ones.
        """
        end = time.monotonic() + timeout
        while missing := [name for name in self.running if not self.runs(name)]:
            if time.monotonic() > end:
                lines = [
                    f"'{name}': {' / '.join(self.printed(name)[-LAST_LINES:])}" for name in missing
                ]
                raise o80.TimeoutError(
                    f"after {timeout:g} s these processes do not run yet:\n" + "\n".join(lines)
                )
            for name in self.ended(POLL):
                raise self.collected(name)

    def runs(self, name: str) -> bool:
        """Whether a process is alive and has begun its work."""
        popen, part = self.running.get(name), self.parts[name]
        if popen is None or popen.poll() is not None:
            return False
        if part.segment is None:
            return any(part.says in line for line in self.printed(name))
        found = {(each.name, each.pid, each.life) for each in o80.segments()}
        return (part.segment, popen.pid, "running") in found

    def ended(self, timeout: float = 0.0) -> list[str]:
        """Returns ended processes that were not collected; waits for one up to `timeout` [s]."""
        end = time.monotonic() + timeout
        while True:
            found = [name for name, popen in self.running.items() if popen.poll() is not None]
            if found or time.monotonic() >= end:
                return found
            time.sleep(POLL)

    def collected(self, name: str) -> PartEndedError:
        """Removes an ended process, which may be started again; returns the reason of its end."""
        code = self.running.pop(name).wait()
        return PartEndedError(name, code, self.printed(name)[-LAST_LINES:])

    def printed(self, name: str) -> list[str]:
        """Returns all lines that a process has printed, also before a restart."""
        return (self._folder / f"{name}.txt").read_text(errors="replace").rstrip().splitlines()

    def close(self) -> None:
        """Ends all in reverse order, and removes the segments of killed ones."""
        try:
            for name in reversed(self.parts):
                if name in self.running:
                    end_child(self.running[name], GRACE, signal.SIGTERM)
                    del self.running[name]
        finally:
            for popen in self.running.values():
                end_child(popen, 0.0)
            self.running.clear()
            for part in self.parts.values():
                if part.segment is not None:
                    with contextlib.suppress(o80.Error):
                        o80.clean(part.segment)


class Watched(Attached):
    """Observes a segment whose backend may end and restart."""

    @property
    def now(self) -> o80.Frontend | None:
        """Frontend of the living backend; None: there is none."""
        return self.frontend(time.monotonic_ns())[0]

    @property
    def missing(self) -> bool:
        """Whether there is no backend, or no new row for a while."""
        age = None if (frontend := self.now) is None else frontend.row_age
        return self._frontend is None or (age is not None and age > SILENT)
