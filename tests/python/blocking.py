"""Every call that can wait forever, and a fixture in which each of them does."""

import contextlib
import inspect
import os
import re
import signal
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import o80
from o80.robots.process import start_process

# imports all lazily loaded names: an interrupt during `exec`, which creates dataclasses, makes
# Python end with the status of an uncaught interrupt, and an interrupt while an import releases
# its lock is lost
for _name in vars(o80)["__all__"]:
    getattr(o80, _name)


@dataclass(frozen=True)
class Call:
    """Source of a call that waits forever, source of the call that ends it, and its result."""

    source: str
    closing: str
    raises: str = "Closed"  # name of the raised o80 exception; "": returns a result


# by method name; the objects are attributes of a Place
CALLS = {
    "Frontend": Call("o80.Frontend(late, None)", "begin(late)", ""),
    "Frontend.wait_for": Call("silent.wait_for(10**12)", "silent.close()"),
    "Frontend.wait_for_next": Call("silent.wait_for_next()", "silent.close()"),
    "Frontend.stream": Call("list(silent.stream())", "silent.close()"),
    "Frontend.stream of a reader": Call("list(reader.stream())", "reader.close()"),
    "wait_for_first": Call("o80.wait_for_first([silent])", "silent.close()"),
    "Frontend.pulse_and_wait": Call(
        "(silent.add_command(0, 1.0), silent.pulse_and_wait())", "silent.close()"
    ),
    "Frontend.pulse_and_wait, bursting": Call(
        "(standing.add_command(0, 1.0), standing.pulse_and_wait())", "standing.close()"
    ),
    "Frontend.move_to": Call("silent.move_to(0, 1.0, tolerance=0.1)", "silent.close()"),
    "Frontend.move_to, bursting": Call(
        "standing.move_to(0, 1.0, tolerance=0.1)", "standing.close()"
    ),
    "Chunks.wait": Call(
        "(plan := silent.chunks(step=5), plan.send([[0.0, 0.0]]), plan.wait())", "silent.close()"
    ),
    "SentChunk.wait": Call("silent.chunks(step=5).send([[0.0, 0.0]]).wait()", "silent.close()"),
    "Frontend.request": Call("silent.request('home')", "silent.close()"),
    "Frontend.resume": Call("(silent.halt(), silent.resume(timeout=None))", "silent.close()"),
    "halt": Call("o80.halt(late, timeout=None)", "begin(late)", ""),
    "Frontend.control": Call("silent.control(None).__enter__()", "silent.close()"),
    "Frontend.reattach": Call("gone.reattach(None)", "gone.close()"),
    "Frontend.burst": Call("standing.burst(5)", "standing.close()"),
    "Frontend.burst, inline": Call("inline.burst(10**12)", "inline.close()"),
    "burst": Call("o80.burst({standing: 5})", "standing.close()"),
    "BurstGroup.wait": Call("o80.burst({standing: 5}, wait=False).wait()", "standing.close()"),
    "Burst.wait": Call("standing.burst(5, wait=False).wait()", "standing.close()"),
    "PreparedBurst.run": Call(
        "[(b.targets.fill(0.5), b.run()) for b in [standing.prepared_burst(5)]]", "standing.close()"
    ),
    "Batch.wait": Call("(silent.add_command(1, 1.0), silent.pulse().wait())", "silent.close()"),
    "Backend.step": Call("stepping.step()", "stepping.close()"),
    "Playback.wait": Call("playback.wait()", "playback.close()", ""),
    "Process.wait": Call("process.wait()", "process.stop()", ""),
    "Process.stop": Call("frozen.stop(1e6)", "os.kill(frozen.pid, SIGCONT)", ""),
    "stop": Call("o80.stop(frozen.segment, 1e6)", "None", ""),
    "Process.frontend": Call("unborn.frontend(None)", "begin(unborn.segment)", ""),
    "Robot.start": Call(
        "start_process([RUN, never], late, [], None)", "open(never, 'wb').close()", "DriverError"
    ),
}

# their copies run in this process: no other process can delay them
COMPUTING = {"GroupBurst.run", "GroupRequest.run", "InlineGroup.request", "InlineGroup.resume"}


def waiting_methods() -> set[str]:
    """Names all public functions and methods with a timeout that can wait."""
    found = set()
    for name in [*vars(o80)["__all__"], "robots.Robot", "robots.Process"]:
        thing: Any = o80
        for part in name.split("."):
            thing = getattr(thing, part)
        short = thing.__name__ if isinstance(thing, type) else name.rpartition(".")[2]
        if callable(thing) and not isinstance(thing, type) and "timeout" in signature_of(thing):
            found.add(short)
        if not isinstance(thing, type) or issubclass(thing, BaseException):
            continue
        if "timeout" in signature_of(thing):
            found.add(short)
        found |= {
            f"{short}.{method}"
            for method in dir(thing)
            if not method.startswith("_") and "timeout" in signature_of(getattr(thing, method))
        }
    return found - COMPUTING


def signature_of(thing: Any) -> str:
    """Returns the signature of a Python or compiled function."""
    try:
        return str(inspect.signature(thing))
    except (TypeError, ValueError):
        return re.split(r"->", getattr(thing, "__doc__", None) or "")[0]


class Place:
    """Backends that never iterate, a robot's processes, and their frontends.

    `name` is the prefix of the segments. The sources above use the attributes' names.
    """

    def __init__(self, name: str, folder: Path) -> None:
        self._stack = contextlib.ExitStack()
        joints = o80.robots.load("two_joints")
        self.late = f"{name}-late"
        self.begun: set[str] = set()
        self.never = str(folder / "never.so")
        os.mkfifo(self.never)
        self.silent_backend = self._enter(
            o80.Backend(f"{name}-silent", ["a", "b"], requests={"home": None}, lanes=32)
        )
        self.silent_backend.on("home", lambda _fields: None)
        self.standing_backend = self._enter(
            o80.Backend(f"{name}-standing", ["a", "b"], bursting=True, lanes=32)
        )
        self.stepping = self._enter(o80.Backend(f"{name}-stepping", ["a"], bursting=True))
        for backend in (self.silent_backend, self.standing_backend, self.stepping):
            backend.publish([0.0] * len(backend.schema["actuators"]))
        with o80.Backend(f"{name}-gone", ["a"]) as ended:
            ended.publish([0.0])
            self.gone = self._enter(o80.Frontend(f"{name}-gone"))
        self.process = self._enter(joints.start(f"{name}-process"))
        self.frozen = self._enter(joints.start(f"{name}-frozen"))
        os.kill(self.frozen.pid, signal.SIGSTOP)
        self.unborn = self._enter(joints.start(f"{name}-unborn"))
        self.unborn.stop()
        self.inline = self._enter(joints.inline(f"{name}-inline"))
        with (
            joints.inline(f"{name}-played") as arm,
            o80.Recording(folder / "run.mcap", arm),
        ):
            arm.burst(10)
        self.playback = self._enter(o80.play(folder / "run.mcap", loop=True))
        self.open_frontends()

    def _enter(self, owner: Any) -> Any:
        return self._stack.enter_context(owner)

    def open_frontends(self) -> None:
        """Opens new frontends for the caller."""
        self.silent = self._enter(o80.Frontend(self.silent_backend.segment))
        self.reader = self._enter(o80.Frontend(self.silent_backend.segment, read_only=True))
        self.standing = self._enter(o80.Frontend(self.standing_backend.segment))

    def begin(self, segment: str) -> None:
        """Starts the awaited backend, once."""
        if segment not in self.begun:
            self.begun.add(segment)
            self._enter(o80.Backend(segment, ["a"])).publish([0.0])

    def names(self) -> dict[str, Any]:
        """Returns the names for a source, with the frontends that were opened last."""
        tools = {
            "o80": o80,
            "os": os,
            "start_process": start_process,
            "RUN": o80.prefix() / "bin" / "o80-run",
            "begin": self.begin,
            "SIGCONT": signal.SIGCONT,
        }
        return {**vars(self), **tools}

    def close(self) -> None:
        with contextlib.suppress(ProcessLookupError, o80.Error):
            os.kill(self.frozen.pid, signal.SIGCONT)
        self._stack.close()
        for entry in o80.segments():
            if entry.name.startswith(self.late[: -len("late")]) and not entry.alive:
                o80.clean(entry.name)


@contextlib.contextmanager
def place(name: str, folder: Path) -> Iterator[Place]:
    """Opens a place, and closes it after the block."""
    made = Place(name, folder)
    try:
        yield made
    finally:
        made.close()
