"""Signals in every call that waits."""

import contextlib
import dis
import itertools
import os
import pty
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from types import CodeType, FrameType
from typing import Any, cast

import pytest
from blocking import CALLS
from processes import WAIT, Running

import o80
from o80.base.child_process import end_child, start_child
from o80.recording.locked_file import LockedFile
from o80.robots.process import Process


@cache
def moments_of(code: CodeType) -> frozenset[int]:
    """Offsets before which Python checks for signals: after a call, at the begin of a loop.

    Elsewhere an interrupt can cause states that a signal cannot, such as an exception that stays
    handled.
    """
    looked = set()
    after = False
    for each in dis.get_instructions(code):
        if after:
            looked.add(each.offset)
        after = each.opname.startswith("CALL") or each.opname == "RESUME"
        if "JUMP_BACKWARD" in each.opname:
            looked.add(each.argval)
    return frozenset(looked)


def interrupted(block: Callable[[], object], moment: int) -> BaseException | None:
    """Calls `block` with an interrupt at this moment; returns the error, None if it ended before.

    Python's modules may raise another exception instead, for example of an unlocked lock.
    `threading` is left out: between the last instruction of a `with` and its end, where no signal
    is handled, an interrupt would leave the lock of all threads taken.
    """
    left = moment

    def trace(frame: FrameType, event: str, _: object) -> Any:
        nonlocal left
        frame.f_trace_opcodes = frame.f_code.co_filename != threading.__file__
        left -= event == "opcode" and frame.f_lasti in moments_of(frame.f_code)
        if left == 0:
            raise KeyboardInterrupt
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        block()
    except BaseException as error:
        if left > 0:
            raise
        return error
    finally:
        sys.settrace(before)
    return None


def at_every_moment(block: Callable[[], object], step: int = 1) -> Iterator[BaseException | None]:
    """Calls `block` again and again, each time interrupted `step` moments later."""
    block()  # a first call imports all: an interrupted import would leave its lock taken
    for moment in itertools.count(1, step):
        errors = [interrupted(block, moment)]  # a variable would keep the exception
        if errors[0] is None:
            return
        yield errors.pop()


PROGRAM = """
import os, signal, sys, time
from pathlib import Path
from blocking import CALLS, Place
here = Place({name!r}, Path({folder!r}))
pulsed = []
for name, call in CALLS.items():
    here.open_frontends()
    names = here.names()
    code = compile(call.source, name, "eval")
    ended = "by itself"
    try:
        try:
            print("ready", flush=True)
            # compiled before: eval of a text tells Python that nobody caught the interrupt
            eval(code, names)
        except KeyboardInterrupt:
            print("interrupted", time.monotonic_ns(), name, flush=True)
            ended = "by Ctrl-C"
    except KeyboardInterrupt:
        ended = "by Ctrl-C twice"
    # all is usable as before
    assert names["silent"].latest().iteration == 0
    assert names["silent"].added == 0, name
    assert names["standing"].history().iteration.tolist() == [0]
    if name == "Frontend.burst, inline":
        reached = here.inline.published
        assert here.inline.burst(1).iteration == reached + 1
    print(ended, flush=True)
os.kill(here.frozen.pid, signal.SIGCONT)
here.close()
"""


def in_a_wait(process: int) -> bool:
    """Whether its main thread sleeps in the kernel, or computes a burst."""
    stat = Path(f"/proc/{process}/stat").read_text()
    return stat.rpartition(")")[2].split()[0] in "SR"


# rule O9
def test_ctrl_c_ends_every_wait_and_leaves_everything_usable(
    segment: str, tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    text = PROGRAM.format(name=segment, folder=str(tmp_path))
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])}
    program = Running(sys.executable, "-c", text, env=environment)
    watch = threading.Timer(WAIT, program.kill)
    watch.start()
    delays = {}
    for name in CALLS:
        assert program.stdout.readline() == "ready\n", program.stderr.read()
        while not in_a_wait(program.pid):
            pass
        sent = time.monotonic_ns()
        program.send_signal(signal.SIGINT)
        interrupted = program.stdout.readline().split(maxsplit=2)
        assert interrupted[:1] == ["interrupted"], (name, program.stderr.read())
        assert interrupted[2].strip() == name
        delays[name] = (int(interrupted[1]) - sent) * 1e-6
        assert program.stdout.readline() == "by Ctrl-C\n"
    _, errors = program.communicate(timeout=WAIT)
    watch.cancel()

    assert program.returncode == 0, errors
    # a figure for the report, no limit: the machine may be slow
    record_property("longest delay of Ctrl-C [ms]", max(delays.values()))
    assert all(delay < WAIT * 1e3 for delay in delays.values())


@contextlib.contextmanager
def handling(number: int, handler: Callable[..., object]) -> Iterator[None]:
    """Installs a signal handler for the block."""
    before = signal.signal(number, handler)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(number, before)


@contextlib.contextmanager
def alarm_in(seconds: float) -> Iterator[None]:
    """Sends SIGALRM during the block; on a slow machine before its first call."""
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


def test_a_handler_that_returns_lets_the_wait_go_on_with_its_timeout(arm: o80.Frontend) -> None:
    heard: list[int] = []
    with handling(signal.SIGALRM, lambda number, _: heard.append(number)):
        signal.setitimer(signal.ITIMER_REAL, 0.02, 0.02)
        while len(heard) < 3:  # a busy machine may deliver few in the time of a wait
            begun = time.monotonic()
            with pytest.raises(o80.TimeoutError):  # no signal begins the wait anew
                arm.wait_for(10, timeout=0.4)
            assert time.monotonic() - begun >= 0.4


def test_a_handler_that_raises_ends_the_wait_with_that(process: o80.robots.Process) -> None:
    class EnoughError(Exception):
        pass

    def enough(*_: object) -> None:
        raise EnoughError

    with handling(signal.SIGALRM, enough), process.frontend() as arm:
        for wait in (
            lambda: arm.wait_for(10**12, WAIT),
            lambda: process.wait(WAIT),
            lambda: o80.Frontend("nobody-has-this-name", WAIT),
        ):
            with pytest.raises(EnoughError), alarm_in(0.01):
                wait()
        arm.wait_for(arm.published + 2, WAIT)


def test_a_signal_in_the_wait_of_another_thread_reaches_the_main_one(arm: o80.Frontend) -> None:
    rows: list[int] = []
    waiting = threading.Thread(target=lambda: rows.append(arm.wait_for(3, WAIT).iteration))
    heard = threading.Event()
    with handling(signal.SIGUSR1, lambda *_: heard.set()):
        waiting.start()
        assert waiting.ident is not None
        signal.pthread_kill(waiting.ident, signal.SIGUSR1)
        while not heard.is_set():  # Python runs handlers in the main thread, in its waits too
            with contextlib.suppress(o80.TimeoutError):
                arm.wait_for(5, timeout=0.1)
    assert waiting.is_alive()

    arm.burst(3)
    waiting.join(WAIT)

    assert rows == [3]


def test_a_handler_may_close_what_is_waited_for(arm: o80.Frontend, segment: str) -> None:
    closing = handling(signal.SIGALRM, lambda *_: arm.close())
    with closing, alarm_in(0.01), pytest.raises(o80.Closed, match=segment):
        arm.burst(10**12)

    assert segment not in [entry.name for entry in o80.segments()]


def test_a_handler_cannot_burst_within_a_burst(arm: o80.Frontend) -> None:
    refused: list[BaseException] = []

    def burst(*_: object) -> None:
        try:
            arm.burst(1)
        except o80.Error as error:
            refused.append(error)
            arm.add_purge()

    with handling(signal.SIGALRM, burst):
        while not refused:  # the alarm can come before the burst
            with alarm_in(0.01):
                arm.burst(1_000_000)

    assert "this thread already runs a burst" in str(refused[0])
    assert arm.added == 1
    arm.forget_added()
    reached = arm.published
    assert arm.burst(1).iteration == reached + 1


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_an_interrupt_at_any_moment_gives_control_back(process: o80.robots.Process) -> None:
    with process.frontend() as arm, process.frontend() as other:

        def block() -> None:
            with arm.control(WAIT), arm.control(WAIT) as same:
                assert same is arm

        moments = 0
        for error in at_every_moment(block):
            moments += 1
            with other.control(WAIT):  # also while the traceback keeps the frames
                assert isinstance(error, KeyboardInterrupt)
        assert moments > 5


TWICE = """
import os, signal, sys, o80
with o80.robots.load("two_joints").start({name!r}) as process, process.frontend() as arm:
    arm.add_command(0, 1.0, duration=1e6)
    try:
        print(process.pid, flush=True)
        arm.pulse_and_wait()
    except KeyboardInterrupt:
        os.kill(process.pid, signal.SIGSTOP)  # it does not stop by itself
        print("once", flush=True)
        raise
"""


def test_ctrl_c_twice_ends_a_program_whose_robot_does_not_stop(segment: str) -> None:
    program = Running(sys.executable, "-c", TWICE.format(name=segment))
    robot = int(program.stdout.readline())
    program.send_signal(signal.SIGINT)
    assert program.stdout.readline() == "once\n"

    # again; once more if that came before the program began to wait for its robot
    errors = ""
    for _ in range(int(WAIT)):
        program.send_signal(signal.SIGINT)
        with contextlib.suppress(subprocess.TimeoutExpired):
            _, errors = program.communicate(timeout=1)
            break

    assert program.returncode in (-signal.SIGINT, 1), errors
    assert "KeyboardInterrupt" in errors
    if Path(f"/proc/{robot}").exists():
        os.kill(robot, signal.SIGCONT)  # it was told to stop before
    while any(e.name == segment for e in o80.segments()):
        with contextlib.suppress(o80.errors.SegmentTaken):  # it is still ending
            o80.clean(segment)
        time.sleep(0.01)


AT_A_TERMINAL = """
import os, time, o80
with o80.robots.load("two_joints").start({name!r}) as process:
    assert os.getsid(process.pid) == os.getsid(0), "it shares its scheduling group"
    with process.frontend() as frontend:
        try:
            print("ready", flush=True)
            time.sleep(60)
        except KeyboardInterrupt:
            # a robot that had been interrupted too would have stopped long before
            frontend.wait_for(frontend.latest().iteration + 300, timeout=60)
            print("both live", flush=True)
"""


def test_ctrl_c_at_a_terminal_does_not_reach_the_robot(segment: str) -> None:
    program, terminal = pty.fork()
    if program == 0:
        os.execv(sys.executable, [sys.executable, "-c", AT_A_TERMINAL.format(name=segment)])
    printed = b""
    watch = threading.Timer(WAIT, os.kill, (program, signal.SIGKILL))
    watch.start()
    with contextlib.suppress(OSError):  # the end of a terminal
        while some := os.read(terminal, 1024):
            interrupt = b"ready" not in printed and b"ready" in printed + some
            printed += some
            if interrupt:
                os.write(terminal, b"\x03")
    _, status = os.waitpid(program, 0)
    watch.cancel()
    os.close(terminal)
    assert os.waitstatus_to_exitcode(status) == 0, printed.decode()
    assert b"both live" in printed


def inline(name: str, _: Path) -> None:
    with o80.robots.load("two_joints").inline(name) as arm:
        arm.burst(1)


def embedded(name: str, _: Path) -> None:
    with o80.Backend(name, ["a"]) as backend:
        backend.publish([0.0])


def commanding(name: str, _: Path) -> None:
    with o80.Frontend(name) as arm:
        arm.purge()


def recording(name: str, folder: Path) -> None:
    with o80.Recording(folder / "run.mcap", name, proceed=True):
        pass


def in_a_process(name: str, _: Path) -> None:
    with o80.robots.load("two_joints").start(name):
        pass


@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_a_child_that_is_lost_ends() -> None:
    """As when Ctrl-C comes between the start of a process and the object that keeps it."""
    child = start_child(["cat"])
    end = os.pidfd_open(child.pid)
    try:
        del child
        assert select.select([end], [], [], WAIT)[0]
    finally:
        os.close(end)


ENDING = """
import signal, sys, time
def end(*_):
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # as a robot at the end of its process
    print("ended", flush=True)
signal.signal(signal.SIGTERM, end)
print("ready", flush=True)
sys.stdin.read()
if signal.getsignal(signal.SIGTERM) is end:  # the input has ended first
    end()
    time.sleep(60)
"""


def test_a_child_that_is_ending_gets_no_signal(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither after the end of its input nor by a second thread that ends it."""
    child = start_child([sys.executable, "-c", ENDING], stdout=subprocess.PIPE)
    output, pipe = child.stdout, child.stdin
    assert output is not None
    assert pipe is not None
    seen, end, send = output.readline, pipe.close, child.send_signal
    signals: list[int] = []

    def send_signal(number: int) -> None:
        signals.append(number)
        send(number)

    monkeypatch.setattr(child, "send_signal", send_signal)
    assert seen() == b"ready\n"

    class SlowPipe:
        def close(self) -> None:
            if not signals:
                end()
            seen()  # until the child is ending
            child.stdin = pipe
            end_child(child, WAIT, signal.SIGTERM)

    child.stdin = cast("Any", SlowPipe())
    with output:
        end_child(child, WAIT, signal.SIGTERM)
    child.stdin = pipe

    assert child.returncode == 0


@pytest.mark.parametrize("kind", [o80.InlineGroup, o80.Recording, Process, LockedFile])
def test_what_was_interrupted_before_it_had_anything_is_dropped(kind: Any) -> None:
    kind.__del__(kind.__new__(kind))


@pytest.mark.filterwarnings(
    "ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning"
)
@pytest.mark.parametrize(
    ("take", "step"),
    [(inline, 5), (embedded, 3), (commanding, 1), (recording, 17), (in_a_process, 17)],
)
def test_what_an_interrupt_left_is_given_back_with_its_exception(
    segment: str, tmp_path: Path, take: Callable[[str, Path], None], step: int
) -> None:
    name = f"{segment}-robot"
    other = f"{segment}-other"
    with o80.robots.load("two_joints").inline(other, lanes=1):
        there = other if take in (commanding, recording) else name
        # a lane, a name or a file that is left taken makes the next call fail
        for error in at_every_moment(lambda: take(there, tmp_path), step):
            del error
            end = time.monotonic() + WAIT
            while [entry.name for entry in o80.segments()] != [other] or records():
                assert time.monotonic() < end, o80.segments()
                # a robot's process ends when its pipe is closed, a recording's thread that reads
                # at this moment when it has read
                time.sleep(0.001)


def records() -> bool:
    return any(thread.name == "o80-recording" for thread in threading.enumerate())
