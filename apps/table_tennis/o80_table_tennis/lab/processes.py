"""Starts and ends the processes of the lab, and says which of them has ended and why.

The processes know nothing of each other's start: each waits by itself for what it needs, so they
may be started in any order. They end in order when the supervisor does, in whatever way: a signal
of the kernel tells them (PR_SET_PDEATHSIG), so that a supervisor that is killed leaves nothing.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import select
import signal
import subprocess
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import o80
from o80.base.lifecycle import Closeable

LOOK = 0.01
"""Between two looks at what a process that starts has done [s]; its end is noticed at once."""
GRACE = 5.0
"""For a process to end in order; then it is killed [s]."""
LAST_LINES = 8
"""Number of the last lines of its output, which say why a process has ended."""
PR_SET_PDEATHSIG = 1
_libc = ctypes.CDLL(None, use_errno=True)


@dataclass(frozen=True)
class Part:
    """One process of the lab."""

    name: str
    command: tuple[str, ...]
    segment: str | None = None
    """Name of its backend's segment; the part counts as running while the segment does."""
    says: str | None = None
    """Text of a process without a segment: it runs when it has printed this."""
    rate: float | None = None
    """Rows a second that are asked for; None: it has none, or runs only when asked."""
    needs: tuple[str, ...] = ()
    """Parts that it reads or commands; it waits for them itself."""
    output: Path | None = None
    """File that the processes write beside their segments."""


class PartEndedError(RuntimeError):
    """A process has ended that nobody had asked to."""

    def __init__(self, part: str, code: int, lines: Sequence[str]) -> None:
        self.part, self.code, self.lines = part, code, tuple(lines)
        told = "".join(f"\n  {line}" for line in lines) or "\n  (it printed nothing)"
        super().__init__(f"the process '{part}' {how_it_ended(code)}. It printed last:{told}")


def how_it_ended(code: int) -> str:
    """Text for an exit code of `subprocess`, such as "was killed by SIGKILL"."""
    if code >= 0:
        return f"ended with exit code {code}"
    try:
        return f"was killed by {signal.Signals(-code).name}"
    except ValueError:
        return f"was killed by signal {-code}"


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
        self._ran: set[str] = set()
        self.started_at: dict[str, int] = {}
        """When each was started the last time [ns, monotonic]."""

    # ------------------------------------------------------------------ start

    def start(self, names: Iterable[str] | None = None) -> None:
        """Starts processes, in this order, without waiting; None: all. See `wait_until_running`."""
        for name in self.parts if names is None else names:
            self._start(self.parts[name])

    def _start(self, part: Part) -> None:
        if part.name in self._running:
            raise RuntimeError(f"the process '{part.name}' runs already")
        with self._output_of(part.name).open("ab") as output:
            self.started_at[part.name] = time.monotonic_ns()
            self._running[part.name] = subprocess.Popen(
                part.command,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                # Ctrl-C reaches only the supervisor, which ends the others in order
                process_group=0,
                preexec_fn=_ends_with(os.getpid()),
            )
        self._ran.add(part.name)

    def wait_until_running(self, timeout: float) -> None:
        """Waits for the segments, or the words, of all processes that were started.

        Raises PartEndedError if one ends meanwhile, o80.TimeoutError with those that do not run.
        """
        end = time.monotonic() + timeout
        missing = set(self._running)
        while missing := {name for name in missing if not self.runs(name)}:
            if time.monotonic() > end:
                raise o80.TimeoutError(self._why_not_running(missing, timeout))
            self.check(LOOK)

    def runs(self, name: str) -> bool:
        """Whether a process is there and has begun its work."""
        popen, part = self._running.get(name), self.parts[name]
        if popen is None or popen.poll() is not None:
            return False
        if part.segment is not None:
            return any(
                each.name == part.segment and each.pid == popen.pid and each.life == "running"
                for each in o80.segments()
            )
        return part.says is None or part.says in self.printed(name)

    def _why_not_running(self, missing: set[str], timeout: float) -> str:
        told = []
        for name in sorted(missing):
            lines = self.last_lines(name) or ["(it printed nothing)"]
            waits = self.parts[name].needs
            told.append(f"'{name}'" + (f", which needs {', '.join(waits)}" if waits else ""))
            told += [f"  {line}" for line in lines]
        return f"after {timeout:g} s these processes do not run yet:\n" + "\n".join(told)

    # ------------------------------------------------------------------ watch

    def check(self, timeout: float = 0.0) -> None:
        """Waits at most `timeout` [s]. Raises PartEndedError as soon as a process has ended."""
        for name in self.ended(timeout):
            raise self.collected(name)

    def ended(self, timeout: float = 0.0) -> list[str]:
        """The processes that have ended and were not collected; waits for one at most so long."""
        found = self._ended_now()
        if found or timeout <= 0 or not self._running:
            return found
        ends = select.poll()
        with contextlib.ExitStack() as stack:
            for popen in self._running.values():
                life = os.pidfd_open(popen.pid)
                stack.callback(os.close, life)
                ends.register(life, select.POLLIN)
            ends.poll(timeout * 1e3)
        return self._ended_now()

    def _ended_now(self) -> list[str]:
        return [name for name, popen in self._running.items() if popen.poll() is not None]

    def collected(self, name: str) -> PartEndedError:
        """Takes a process that has ended off the list, and tells how; it may be started again."""
        code = self._running.pop(name).wait()
        return PartEndedError(name, code, self.last_lines(name))

    def pid(self, name: str) -> int:
        """Process id of a process that runs. Raises KeyError."""
        return self._running[name].pid

    @property
    def running(self) -> list[str]:
        """Names of the processes that were started and have not been collected."""
        return list(self._running)

    def printed(self, name: str) -> str:
        """Output of a process, over all its starts."""
        try:
            return self._output_of(name).read_text(errors="replace")
        except FileNotFoundError:
            return ""

    def last_lines(self, name: str) -> list[str]:
        """Last lines of its output."""
        return self.printed(name).rstrip().splitlines()[-LAST_LINES:]

    def _output_of(self, name: str) -> Path:
        return self._folder / f"{name}.txt"

    # ------------------------------------------------------------------ end

    def kill(self, name: str) -> PartEndedError:
        """Kills a process with signal 9, and waits for its end."""
        popen = self._running[name]
        popen.kill()
        popen.wait()
        return self.collected(name)

    def stop(self, names: Iterable[str] | None = None) -> None:
        """Ends processes in order: those that others need last. Kills those that do not obey."""
        leaving = {name for name in self._running if names is None or name in set(names)}
        while leaving:
            needed = {need for name in leaving for need in self.parts[name].needs}
            first = leaving - needed or leaving
            self._stop_at_once(first)
            leaving -= first

    def _stop_at_once(self, names: Iterable[str]) -> None:
        for name in names:
            self._running[name].terminate()
        end = time.monotonic() + GRACE
        for name in names:
            popen = self._running[name]
            try:
                popen.wait(max(0.0, end - time.monotonic()))
            except subprocess.TimeoutExpired:
                popen.kill()
                popen.wait()
            del self._running[name]

    def close(self) -> None:
        """Ends all, and removes the segments of those that were killed; may be called twice."""
        try:
            self.stop()
        finally:
            for popen in self._running.values():
                popen.kill()
            for popen in self._running.values():
                popen.wait()
            self._running.clear()
            for name in self._ran:
                segment = self.parts[name].segment
                if segment is not None:
                    with contextlib.suppress(o80.Error):
                        o80.clean(segment)
            self._ran.clear()

    def processor_seconds(self) -> Mapping[str, float]:
        """Processor time of each process that runs, since its start [s]."""
        return {
            name: seconds
            for name, popen in self._running.items()
            if (seconds := processor_seconds(popen.pid)) is not None
        }


def processor_seconds(pid: int | str) -> float | None:
    """Processor time of a process, all threads, user and system [s]; None: it is gone."""
    try:
        words = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return None
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def _ends_with(supervisor: int) -> Callable[[], None]:
    """First call of a new process: asks the kernel for SIGTERM when the supervisor dies."""

    def ask() -> None:
        _libc.prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
        if os.getppid() != supervisor:  # it died before the kernel was asked
            os._exit(1)

    return ask
