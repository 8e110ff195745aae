"""Whatever is closed, or belongs to the parent of a forked process, says so."""

import contextlib
import importlib
import operator
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from processes import WAIT, end_of, run_python

import o80
from o80.rows.layout import HEAD

# arguments of what needs some, by class and name; None: nothing of the segment is used
CALLS: dict[str, dict[str, Callable[[Any], Any]]] = {
    "Frontend": {
        "add_command": lambda it: it.add_command(0, 0.1),
        "add_trajectory": lambda it: it.add_trajectory([[0.1, 0.2]]),
        "add_request": lambda it: it.add_request("reset"),
        "request": lambda it: it.request("reset", timeout=WAIT),
        "control": lambda it: it.control(WAIT).__enter__(),
        "wait_for": lambda it: it.wait_for(0, WAIT),
        "at_time": lambda it: it.at_time(0),
        "wait_for_next": lambda it: it.wait_for_next(WAIT),
        "pulse_and_wait": lambda it: it.pulse_and_wait(WAIT),
        "preview": lambda it: it.preview(0, 0.1),
        "move_to": lambda it: it.move_to(0, 0.1, tolerance=0.1, timeout=WAIT),
        "mark": lambda it: it.mark("here"),
        "chunks": lambda it: it.chunks(step=5),
        "reattach": lambda it: it.reattach(WAIT),
        "burst": lambda it: it.burst(timeout=WAIT),
    },
    "Backend": {
        "publish": lambda it: it.publish([0.0]),
        "step": lambda it: it.step(WAIT),
        "on": lambda it: it.on("home", print),
        "on_halt": lambda it: it.on_halt(print),
        "on_resume": lambda it: it.on_resume(print),
        "interrupt": lambda it: it.interrupt(0),
        "running": lambda it: it.running("home"),
        "progress": lambda it: it.progress("home", "half"),
        "end_request": lambda it: it.end_request("home"),
    },
    "Process": {"wait": lambda it: it.wait(WAIT)},
    "Burst": {"wait": lambda it: it.wait(WAIT)},
    "Batch": {"wait": lambda it: it.wait(WAIT)},
    "Stream": {"__next__": next},
}
# what stays true: the description of the robot, and what was seen
DATA = {
    "Frontend": {
        *("segment", "schema", "robot", "actuators", "requests", "enums", "period", "frequency"),
        *("bursting", "epoch", "initial_states", "closed", "close", "aio", "provenance", "model"),
    },
    "Backend": {"segment", "schema", "close"},
    "Process": {"segment", "frontend"},
    "Burst": {"batch"},
    "Batch": {"seen", "clipped"},
    "Stream": {"__iter__"},
}
# of a closed frontend: its life is that of its backend
OPEN_WHEN_CLOSED = {"life", "alive", "added", "clipped", "forget_added"}


def uses_of(thing: Any) -> dict[str, Callable[[Any], Any]]:
    """Every public method and property, found by looking: a new one cannot be forgotten."""
    name = type(thing).__name__
    special = {"__next__", "__iter__"} & {*dir(thing)}
    uses: dict[str, Callable[[Any], Any]] = {}
    for member in [*special, *(m for m in dir(type(thing)) if not m.startswith("_"))]:
        if member in DATA[name]:
            continue
        if member in CALLS[name]:
            uses[member] = CALLS[name][member]
        elif callable(getattr(type(thing), member)):
            uses[member] = operator.methodcaller(member)
        else:
            uses[member] = operator.attrgetter(member)
    return uses


def not_raising(
    thing: Any, error: type[BaseException], but: frozenset[str] | set[str] = frozenset()
) -> list[str]:
    """The uses that do not raise it, each with what it did instead."""
    wrong = []
    for member, use in uses_of(thing).items():
        if member in but:
            continue
        try:
            wrong.append(f"{member} gave {use(thing)!r}")
        except error as raised:
            if getattr(thing, "segment", "'") not in str(raised):
                wrong.append(f"{member} does not name the segment: {raised}")
        except BaseException as raised:
            wrong.append(f"{member} raised {raised!r}")
    return wrong


class Things:
    """One of each class that works on a segment."""

    def __init__(self, name: str) -> None:
        joints = o80.robots.load("two_joints")
        with contextlib.ExitStack() as stack:
            self.process = stack.enter_context(joints.start(f"{name}-a"))
            self.frontend = stack.enter_context(self.process.frontend())
            self.frontend.add_command(0, 0.1)
            self.batch = self.frontend.pulse()
            self.batch.wait(WAIT)
            self.stream = self.frontend.stream()
            self.inline = stack.enter_context(joints.inline(f"{name}-b"))
            self.burst = self.inline.burst(3, wait=False)
            self.backend = stack.enter_context(
                o80.Backend(f"{name}-c", ["a"], requests={"home": None})
            )
            self.backend.publish([0.0])
            self.stack = stack.pop_all()


@pytest.fixture
def things(segment: str) -> Iterator[Things]:
    made = Things(segment)
    with made.stack:
        yield made


# ---------------------------------------------------------------------------- closed


@pytest.mark.parametrize(
    ("kind", "but"),
    [
        *(("frontend", OPEN_WHEN_CLOSED), ("inline", OPEN_WHEN_CLOSED | {"reattach"})),
        ("backend", set()),
    ],
)
def test_every_use_of_something_closed_says_so(things: Things, kind: str, but: set[str]) -> None:
    closed = getattr(things, kind)
    closed.close()
    closed.close()

    assert not_raising(closed, o80.Closed, but) == []
    for member in DATA[type(closed).__name__] - {"close"}:
        getattr(closed, member)
    assert "closed" in repr(closed)


def test_control_that_was_not_waited_for_is_given_back(segment: str) -> None:
    with o80.Backend(segment, ["a"]) as backend:
        backend.publish([0.0])
        with o80.Frontend(segment) as one, o80.Frontend(segment) as other:
            with pytest.raises(o80.TimeoutError), one.control(timeout=0.01):
                pytest.fail("nobody granted it")
            other.add_command(0, 1.0)
            batch = other.pulse()
            backend.step()
            backend.publish([1.0])

            assert batch.statuses == ["completed"]


# ---------------------------------------------------------------------------- forked


def in_child(work: Callable[[], object]) -> str:
    """Runs it in a forked child; what it raised, or nothing. Ends it if it hangs."""
    told, tell = os.pipe()
    child = os.fork()
    if child == 0:
        signal.alarm(int(WAIT))
        try:
            work()
        except BaseException as error:
            os.write(tell, repr(error).encode())
        os._exit(0)
    os.close(tell)
    with open(told, "rb") as pipe:
        text = pipe.read().decode()
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    return text if code == 0 else f"it ended with {code}. {text}"


@pytest.mark.parametrize(
    "kind", ["frontend", "inline", "batch", "burst", "stream", "process", "backend"]
)
def test_every_use_in_a_forked_child_says_so_and_leaves_the_parent_alone(
    things: Things, kind: str
) -> None:
    used = getattr(things, kind)

    def use() -> None:
        but = {"reattach"} if kind == "inline" else set()  # nothing to attach to
        assert not_raising(used, o80.UsedAfterFork, but) == []
        assert "parent" in repr(used) or kind not in ("frontend", "inline", "batch", "process")
        for member in DATA[type(used).__name__] - {"close", "frontend", "__iter__"}:
            getattr(used, member)
        for end in ("close", "__exit__"):
            if hasattr(used, end) and not (kind == "process" and end == "close"):
                getattr(used, end)(*([None] * 3 if end == "__exit__" else []))
        things.__dict__.clear()  # collected in the child

    assert in_child(use) == ""

    assert things.process.alive
    assert things.inline.burst(1).iteration == 4
    things.frontend.add_command(1, 0.2)
    things.frontend.pulse_and_wait(WAIT)
    assert things.batch.statuses == ["completed"]
    assert next(things.stream).iteration > 0
    things.backend.publish([0.5])


def test_the_parent_of_a_fork_in_mid_burst_goes_on_and_its_child_does_not_hang(
    arm: o80.Frontend,
) -> None:
    def burst() -> None:
        with contextlib.suppress(o80.Closed):
            arm.burst(10**12)

    before = arm.published
    threading.Thread(target=burst).start()
    while arm.published == before:
        pass

    def leave() -> None:
        with arm:
            pass
        with o80.Frontend(arm.segment, read_only=True) as again:
            again.wait_for_next(WAIT)

    for _ in range(5):
        assert in_child(leave) == ""
    reached = arm.published
    while arm.published < reached + 1000:  # a reader that is held up would find rows overwritten
        time.sleep(0.001)


def test_a_child_forked_while_other_threads_send_can_close_its_copy(
    process: o80.robots.Process,
) -> None:
    stop = threading.Event()
    with process.frontend() as arm:

        def send() -> None:
            while not stop.is_set():
                with contextlib.suppress(o80.LaneFull):
                    arm.purge()  # without the interpreter, under the lock of what is sent

        threads = [threading.Thread(target=send) for _ in range(2)]
        for thread in threads:
            thread.start()
        told = [in_child(arm.close) for _ in range(40)]
        stop.set()
        for thread in threads:
            thread.join(WAIT)

        assert told == [""] * 40


def test_a_child_forked_while_another_thread_computes_a_value_computes_its_own(
    process: o80.robots.Process, monkeypatch: pytest.MonkeyPatch
) -> None:
    parent, begun, go_on = os.getpid(), threading.Event(), threading.Event()

    class Blocking(tuple[tuple[str, str], ...]):
        def __iter__(self) -> Iterator[tuple[str, str]]:
            if os.getpid() == parent:
                begun.set()
                assert go_on.wait(WAIT)
            return super().__iter__()

    def look() -> None:
        with process.frontend() as arm:
            assert len(arm.history(1)) == 1

    monkeypatch.setattr("o80.rows.layout.HEAD", Blocking(HEAD))
    thread = threading.Thread(target=look)
    thread.start()
    assert begun.wait(WAIT)
    told = in_child(look)
    go_on.set()
    thread.join(WAIT)

    assert told == ""


def test_a_child_forked_while_another_thread_imports_a_module_imports_it_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, go_on = threading.Event(), threading.Event()
    (tmp_path / "slowly_imported.py").write_text("import builtins\nbuiltins.o80_test_wait()\n")
    monkeypatch.syspath_prepend(tmp_path)

    def wait() -> None:
        begun.set()
        assert go_on.wait(WAIT)

    monkeypatch.setattr("builtins.o80_test_wait", wait, raising=False)
    thread = threading.Thread(target=importlib.import_module, args=["slowly_imported"])
    thread.start()
    assert begun.wait(WAIT)
    monkeypatch.setattr("o80.base.lifecycle.LONGEST", WAIT)
    os.register_at_fork(before=go_on.set)  # registered last, so called before the wait of o80
    told = in_child(lambda: importlib.import_module("slowly_imported"))
    thread.join(WAIT)

    assert told == ""


def test_a_robot_does_not_live_on_with_a_child_of_its_killed_parent(segment: str) -> None:
    told, tell = os.pipe()
    starter = os.fork()
    if starter == 0:
        process = o80.robots.load("two_joints").start(segment)
        orphan = os.fork()
        if orphan == 0:
            os.close(tell)
            signal.pause()  # outlives its parent
        os.write(tell, f"{process.pid} {orphan}\n".encode())
        os.kill(os.getpid(), signal.SIGKILL)
    os.close(tell)
    with open(told) as pipe:
        robot, orphan = map(int, pipe.read().split())
    os.waitpid(starter, 0)

    try:
        end_of(robot)
        os.kill(orphan, 0)
    finally:
        os.kill(orphan, signal.SIGKILL)


# ------------------------------- forks inside a function that o80 calls: the child touches no robot


START = """
import os, signal, sys, threading, time
import o80

children = []

def fork():
    if not children:
        sys.stdout.flush()
        children.append(os.fork())

def goes_on():
    "Once in the parent; the child must not come here."
    if children[0] == 0:
        print("the child went on", flush=True)
        os._exit(7)
    code = os.waitstatus_to_exitcode(os.waitpid(children[0], 0)[1])
    print("its child ended with", code, flush=True)
"""

DRIVER = """
class Forks:
    simulated = True
    def __init__(self):
        if sys.argv[2] == "constructor": fork()
    @property
    def actuators(self):
        if sys.argv[2] == "describe": fork()
        return ("joint",)
    def read(self, reading):
        pass

with o80.robots.load(Forks).inline(sys.argv[1]) as robot:
    goes_on()
    assert robot.burst(1).iteration == 1
"""

HANDLERS = """
with o80.Backend(sys.argv[1], ["joint"], requests={"home": None}) as backend:
    place = {"request": lambda handler: backend.on("home", lambda fields: handler()),
             "halt": backend.on_halt, "resume": backend.on_resume}[sys.argv[2]]
    place(fork)
    backend.publish([0.0])
    with o80.Frontend(sys.argv[1]) as frontend:
        if sys.argv[2] == "request":
            frontend.add_request("home")
            frontend.pulse()
        if sys.argv[2] in ("halt", "resume"):
            frontend.halt("test")
            for _ in range(2):
                backend.step()
                backend.publish()
        if sys.argv[2] == "resume":
            resumes = threading.Thread(target=frontend.resume)
            resumes.start()
            while not children:
                backend.step()
                backend.publish()
            resumes.join()
        else:
            backend.step()
            backend.publish()
        goes_on()
        assert frontend.alive
"""

SIGNALS = """
def forks_until_told(used):
    "`used` raises in the child, at once, if the signal came during it; else when it is used again."
    signal.signal(signal.SIGALRM, lambda number, frame: fork())
    signal.setitimer(signal.ITIMER_REAL, 0.05)
    while not children or children[0] == 0:
        try:
            used()
        except o80.UsedAfterFork:
            os._exit(3 if children == [0] else 4)
    goes_on()

robot = o80.robots.load("two_joints")
if sys.argv[2] == "step":
    with o80.Backend(sys.argv[1], ["joint"], bursting=True) as backend:
        backend.publish([0.0])
        def step():
            try:
                backend.step(0.5)
            except o80.TimeoutError:
                pass
        forks_until_told(step)
elif sys.argv[2] == "inline":
    with robot.inline(sys.argv[1]) as arm:
        forks_until_told(lambda: arm.burst(2000))
else:
    with robot.inline(copies=4, threads=int(sys.argv[2]), history=20000) as group:
        burst = group.prepared_burst(20000)
        burst.targets[...] = 0.5
        forks_until_told(burst.run)
"""


def run(program: str, segment: str, place: str) -> tuple[str, str]:
    """Standard output and error of a program with its children."""
    ended = run_python("-c", START + program, segment, place)
    return ended.stdout, ended.stderr


@pytest.mark.parametrize("place", ["constructor", "describe"])
def test_a_child_that_returns_from_the_making_of_a_driver_ends(segment: str, place: str) -> None:
    said, error = run(DRIVER, segment, place)
    assert said == "its child ended with 1\n"
    what = "its constructor" if place == "constructor" else place
    assert f"'forks' forked in {what}, and the child" in error
    assert "os._exit" in error


@pytest.mark.parametrize("place", ["request", "halt", "resume"])
def test_a_child_that_returns_from_a_handler_of_a_backend_ends(segment: str, place: str) -> None:
    said, error = run(HANDLERS, segment, place)
    assert said == "its child ended with 1\n"
    assert f"'{segment}' forked in the handler of a {place}, and the child" in error


@pytest.mark.parametrize("place", ["step", "inline", "1", "3"])
def test_a_child_forked_in_a_signal_handler_runs_no_iteration(segment: str, place: str) -> None:
    said, _ = run(SIGNALS, segment, place)
    assert said == "its child ended with 3\n"
