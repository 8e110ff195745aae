"""The end of the interpreter, in every way, with everything still under way."""

import os
import subprocess
from pathlib import Path

import pytest
from blocking import CALLS
from processes import end_of, run_python

import o80

WORDS_OF_A_CRASH = ("Fatal", "terminate", "exception not rethrown", "Abort", "Segmentation")


def run(program: str, *flags: str) -> subprocess.CompletedProcess[str]:
    """A program of its own; it must end by itself."""
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[1])}
    return run_python(*flags, "-c", program, code=None, env=environment)


def crashes(ended: subprocess.CompletedProcess[str]) -> list[str]:
    return [word for word in WORDS_OF_A_CRASH if word in ended.stderr]


ENDS = {
    "by its last line": ("", 0),
    "by sys.exit": ("sys.exit(3)", 3),
    "by an exception": ("raise RuntimeError('it broke')", 1),
    "by os._exit": ("os._exit(4)", 4),
    "by SIGTERM": ("os.kill(os.getpid(), 15); signal.pause()", -15),
    "by SIGKILL": ("os.kill(os.getpid(), 9)", -9),
}


@pytest.mark.parametrize(
    ("way", "block"),
    [*((way, False) for way in ENDS), ("by sys.exit", True), ("by an exception", True)],
)
def test_a_robot_stops_in_order_however_the_program_that_started_it_ends(
    segment: str, way: str, block: bool
) -> None:
    end, code = ENDS[way]
    start = f"o80.robots.load('two_joints').start({segment!r})"
    body = f"print(process.pid, flush=True); arm = process.frontend(); {end}"
    program = "import os, signal, sys, o80\n" + (
        f"with {start} as process:\n    {body}" if block else f"process = {start}\n{body}"
    )

    ended = run(program)

    assert ended.returncode == code, ended.stderr
    assert crashes(ended) == []
    end_of(int(ended.stdout))
    # stopped in order, it has taken its name along
    assert segment not in [entry.name for entry in o80.segments()]


DAEMONS = """
import faulthandler, sys, threading, time
from pathlib import Path
from blocking import CALLS, Place
faulthandler.enable()
here = Place({name!r}, Path({folder!r}))
begun = []
def call(source, names):
    begun.append(source)
    try:
        eval(source, names)
    except Exception as error:
        if type(error).__name__ not in ("Closed", "BackendStopped", "DriverError"):
            raise
for name, waiting in CALLS.items():
    if name in {left_out!r}:
        continue
    here.open_frontends()
    threading.Thread(target=call, args=(waiting.source, here.names()), daemon=True).start()
while len(begun) < {count}:
    time.sleep(0.001)
counted = sum(1 for _ in range(300_000))
{end}
"""
# a robot that is frozen ends when it is thawed
LEFT_OUT = {"Process.stop", "Robot.start"}


@pytest.mark.parametrize(
    ("flags", "end"),
    [((), "sys.exit(3)"), ((), "raise RuntimeError('it broke')"), (("-X", "dev"), "")],
    ids=["exits", "raises", "returns, with -X dev"],
)
def test_daemon_threads_in_every_wait_neither_crash_nor_keep_the_interpreter(
    segment: str, tmp_path: Path, end: str, flags: tuple[str, ...]
) -> None:
    program = DAEMONS.format(
        name=segment,
        folder=str(tmp_path),
        left_out=LEFT_OUT,
        count=len(CALLS) - len(LEFT_OUT),
        end="import os; os.kill(here.frozen.pid, 18)\n" + end,
    )

    ended = run(program, *flags)

    assert crashes(ended) == [], ended.stderr
    assert ended.returncode == {"": 0, "sys.exit(3)": 3}.get(end, 1), ended.stderr
    left = [e.name for e in o80.segments() if e.name.startswith(segment) and e.alive]
    assert left == []
    for entry in o80.segments():
        if entry.name.startswith(segment):
            o80.clean(entry.name)


TRANSLATING = """
import builtins, sys, threading, time, o80
arm = o80.robots.load("two_joints").inline({name!r})
reader = o80.Frontend({name!r})
imported, translating = builtins.__import__, threading.Event()

def slow(name, *rest):  # a thread may lose the interpreter while it looks for the class of an error
    if name == "o80.base.errors" and threading.current_thread() is waiting:
        translating.set()
        time.sleep(0.3)
    return imported(name, *rest)

class Late:  # the interpreter takes its time to end
    def __del__(self, sleep=time.sleep):
        sleep(1.0)

sys.late = Late()  # what a function of this module may use lives until the process ends
builtins.__import__ = slow
waiting = threading.Thread(target=reader.wait_for, args=(10**12,), daemon=True)
waiting.start()
reader.close()
translating.wait()
builtins.__import__ = imported
"""


def test_the_interpreter_may_end_while_an_error_becomes_one_of_python(segment: str) -> None:
    ended = run(TRANSLATING.format(name=segment))
    assert crashes(ended) == [], ended.stderr
    assert ended.returncode == 0, ended.stderr


HOT = """
import threading, o80
arm = o80.robots.load("two_joints").inline()
backend = o80.Backend({name!r}, ["a"], bursting=True, requests={{"home": None}})
backend.publish([0.0])
backend.on("home", lambda fields: [None for _ in range(100)] and None)
def iterate():
    while (desired := backend.step()) is not None:
        backend.publish(desired)
def read():
    for observation in o80.Frontend(arm.segment, read_only=True).stream():
        observation.observed, observation.extended, observation.flat()
def burst():
    while True:
        arm.burst(3).desired
def ask():
    with o80.Frontend({name!r}) as asking:
        while True:
            asking.request("home")
            asking.burst(1).observed
def time_out():
    with o80.Frontend({name!r}) as waiting:
        while True:
            try:
                waiting.wait_for(10**12, 0.0)
            except o80.TimeoutError:
                pass
threading.excepthook = lambda _: None
for work in (iterate, read, burst, ask, time_out):
    threading.Thread(target=work, daemon=True).start()
while arm.latest().iteration < 50:  # row 50 may be overwritten before this thread runs again
    pass
"""


def test_daemon_threads_in_full_work_do_not_crash_the_end(segment: str) -> None:
    for _ in range(8):
        ended = run(HOT.format(name=segment), "-X", "faulthandler")
        assert crashes(ended) == [], ended.stderr
        assert ended.returncode == 0, ended.stderr
        assert not any(e.name == segment and e.alive for e in o80.segments())


def test_what_was_never_pulsed_is_warned_about_at_the_end(segment: str) -> None:
    with o80.robots.load("two_joints").start(segment):
        ended = run(
            f"import o80\narm = o80.Frontend({segment!r})\narm.add_command(0, 1.0)\n",
            "-W",
            "always",
        )

    assert ended.returncode == 0
    assert "1 commands were added" in ended.stderr
    assert "never pulsed" in ended.stderr


def test_frontends_are_there_for_what_is_registered_later_to_run_at_exit(segment: str) -> None:
    program = f"""
import atexit
atexit.register(lambda: print("before it was imported:", arm.closed))
import o80
atexit.register(lambda: print("after:", arm.burst(2).iteration, process.alive))
process = o80.robots.load("two_joints").start({segment!r})
arm = o80.robots.load("two_joints").inline()
"""

    ended = run(program)

    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.splitlines() == ["after: 2 True", "before it was imported: True"]


def test_one_that_fails_to_close_does_not_keep_the_others_open(segment: str) -> None:
    program = f"""
import o80
class Stubborn(o80.Frontend):
    def close(self):
        raise RuntimeError("it does not close")
first = o80.robots.load("two_joints").inline({segment!r})
o80.register_frontend("two_joints", Stubborn)
second = o80.robots.load("two_joints").inline()
"""

    ended = run(program)

    assert "it does not close" in ended.stderr
    assert segment not in [entry.name for entry in o80.segments()]
