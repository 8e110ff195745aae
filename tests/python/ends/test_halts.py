"""First the halt, then the complaint: a halt happens whatever else is wrong with the call, the
terminal or the machine."""

import contextlib
import os
import random
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from processes import O80, WAIT, run_o80

import o80


class Unprintable:
    def __str__(self) -> str:
        raise RuntimeError("it has no text")

    __repr__ = __str__


WRONG: list[Any] = [5, None, b"ball", 1.5, ["ball"], Unprintable(), "\udcfcber", "\ud800", "a\0b"]
WRONG += ["x" * 1_000_000, "\N{SNAKE}" * 300, "\x1b[31m\n\u202e", ValueError("hot")]
TIMEOUTS: list[Any] = [float("nan"), -1.0, "5", [1.0], None, float("inf"), 10**400]


@pytest.fixture
def arm(segment: str) -> Iterator[o80.Frontend]:
    with o80.robots.load("two_joints").start(segment) as process, process.frontend() as frontend:
        yield frontend


def number_of(arm: o80.Frontend) -> int:
    """The number of the last halt."""
    return arm.halted.number if arm.halted else 0


def halts_once(arm: o80.Frontend, act: Callable[[], object]) -> BaseException | None:
    """Calls it, which must halt once; the exception that it raised."""
    before = number_of(arm)
    raised = None
    try:
        act()
    except Exception as error:
        raised = error
    halt = arm.halted
    assert halt is not None
    assert halt.number == before + 1
    assert halt.text.isprintable()
    return raised


# rule H2
def test_a_halt_comes_with_any_text(arm: o80.Frontend) -> None:
    for text in WRONG:
        for halt in (arm.halt, lambda text: o80.halt(arm.segment, text)):
            raised = halts_once(arm, lambda halt=halt, text=text: halt(text))  # type: ignore[misc]
            if not isinstance(text, str):
                assert isinstance(raised, (o80.InvalidArgument, RuntimeError)), type(text)


def test_a_halt_comes_with_any_timeout_and_any_further_argument(arm: o80.Frontend) -> None:
    halt: Any = o80.halt
    for timeout in TIMEOUTS:
        halts_once(arm, lambda timeout=timeout: halt(arm.segment, "hot", timeout))  # type: ignore[misc]
    stop: Any = arm.halt
    calls: list[Callable[[], object]] = [
        lambda: halt(arm.segment, "hot", 0.0, 7),
        lambda: halt(arm.segment, reason="hot", wait=True),
        lambda: stop("hot", 7),
        lambda: stop(why="hot"),
        lambda: stop(reason="hot", timeout=1.0),
    ]
    for call in calls:
        raised = halts_once(arm, call)
        assert isinstance(raised, TypeError)
        assert f"'{arm.segment}' is halted (halt {number_of(arm)}), but" in str(raised)
        assert "It takes" in str(raised)
        assert arm.halted is not None
        assert arm.halted.text == "hot"


def test_a_halt_keeps_all_letters_and_ends_at_a_character(arm: o80.Frontend) -> None:
    arm.halt("die Tür klemmt, дверь заклинило, 門 🚪")
    assert arm.halted is not None
    assert arm.halted.text == "die Tür klemmt, дверь заклинило, 門 🚪"
    arm.halt("x" + "ü" * 200)
    assert arm.halted.text == "x" + "ü" * 123


def test_a_backend_and_a_reading_halt_with_any_text(segment: str) -> None:
    with o80.Backend(segment, ["a"], bursting=True) as backend:
        backend.publish([0.0])
        with o80.Frontend(segment) as arm:
            for text in ("die Tür", 5, "\udcfc"):
                halts_once(arm, lambda text=text: backend.halt(text))  # type: ignore[misc]


# ------------------------------------------------------------------------------------- command line


ENVIRONMENTS: list[dict[str, str | None]] = [
    {},
    {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    {"LC_ALL": "xx_XX.broken", "LANG": "C"},
    {"PYTHONIOENCODING": "ascii"},
    {"PYTHONIOENCODING": "utf-16"},
    {"HOME": None, "TERM": None, "PATH": None},
    {"TERM": "dumb", "COLUMNS": "0", "NO_COLOR": ""},
]
OUTPUTS: list[Any] = [subprocess.PIPE, "/dev/full", "closed pipe"]
"""Closed descriptors are to be added with the programs that open them at the start."""
WORDS = [
    *(b"the ball is on the floor", b"-5 degrees off", b"--now", b"--help", b"-h", b"--all", b""),
    *(b"T\xfcr", "Tür".encode(), "门".encode(), b"\xff\xfe", b"\x1b[31m", b"a\nb", b"x" * 100_000),
    *(b"--", b"-", b"--version", b"--segment", b"--timeout=nan", b"$(true)"),
]
IGNORED = [signal.SIGINT, signal.SIGHUP, signal.SIGPIPE, signal.SIGQUIT]


def output_of(drawn: Any) -> Any:
    if drawn == "closed pipe":
        readable, writable = os.pipe()
        os.close(readable)
        return os.fdopen(writable, "wb")
    return Path(drawn).open("wb") if isinstance(drawn, str) else drawn


# rule H2
def test_o80_halt_halts_whatever_else_is_wrong(arm: o80.Frontend, tmp_path: Path) -> None:
    for seed in range(20):
        print(seed)  # shown where it fails
        halt_with_something_wrong(arm, tmp_path, random.Random(seed))


def halt_with_something_wrong(arm: o80.Frontend, tmp_path: Path, draw: random.Random) -> None:
    words = draw.choices(WORDS, k=draw.randrange(4))
    environment = dict(os.environ)
    for name, value in draw.choice(ENVIRONMENTS).items():
        environment.pop(name, None)
        if value is not None:
            environment[name] = value
    outputs = [output_of(draw.choice(OUTPUTS)) for _ in range(2)]
    gone = tmp_path / "gone"
    gone.mkdir()
    before = number_of(arm)

    program = subprocess.Popen(
        [O80, "halt", arm.segment, *words],
        env=environment,
        stdout=outputs[0],
        stderr=outputs[1],
        stdin=draw.choice([subprocess.DEVNULL, None]),
        cwd=gone if draw.random() < 0.5 else "/proc",
    )
    gone.rmdir()
    out, err = program.communicate(timeout=WAIT)
    for file in outputs:
        if file is not subprocess.PIPE:
            with contextlib.suppress(OSError):
                file.close()

    assert number_of(arm) == before + 1
    assert program.returncode == 0
    assert b"Traceback" not in (err or b"")
    if out is not None and environment.get("PYTHONIOENCODING") != "utf-16":
        assert f"halt {before + 1} of {arm.segment}".encode() in out
    assert arm.halted is not None
    text = arm.halted.text
    assert text.isprintable()
    for letters in ("Tür", "门"):
        if letters.encode() in b" ".join(words)[:200]:
            assert letters in text


SIGNALLED = """
import _signal, os, signal, sys
import o80.cli
number, sys.argv = int(sys.argv[1]), ["o80", "halt", *sys.argv[2:]]
def profile(frame, event, argument):
    if event == "c_call" and _signal.getsignal(signal.SIGTSTP) == signal.SIG_IGN:
        os.kill(os.getpid(), number)
        os.write(2, b"sent ")
run = o80.cli._run
def begin(words):
    sys.setprofile(profile)
    run(words)
o80.cli._run = begin
o80.cli.main()
"""


@pytest.mark.parametrize("number", IGNORED)
def test_signals_of_a_terminal_do_not_come_before_the_halt(
    arm: o80.Frontend, number: signal.Signals
) -> None:
    words = [sys.executable, "-c", SIGNALLED, str(int(number)), arm.segment, "hot"]
    done = subprocess.run(words, capture_output=True, timeout=WAIT)
    assert done.returncode == 0, done.stderr
    assert b"sent" in done.stderr
    assert number_of(arm) == 1


@pytest.mark.parametrize("words", [[], ["--help"], ["-h"]])
def test_o80_halt_without_a_name_shows_its_usage(words: list[str]) -> None:
    done = run_o80("halt", *words, code=0 if words else 2)
    assert "Usage: o80 halt SEGMENT [TEXT...]" in done.stdout + done.stderr


def test_o80_halt_takes_no_name_but_the_exact_one(arm: o80.Frontend) -> None:
    for name in (arm.segment[:-1], arm.segment + "x", arm.segment.upper(), "", "--now", "T\udcfcr"):
        assert "othing was halted" in run_o80("halt", name, "hot", code=1).stderr
    assert number_of(arm) == 0


def test_o80_halt_says_that_a_robot_in_its_text_was_not_halted(arm: o80.Frontend) -> None:
    with o80.Backend("second", ["a"]) as backend:
        backend.publish([0.0])
        done = run_o80("halt", arm.segment, "second", code=1)
        assert f"halt 1 of {arm.segment}" in done.stdout
        assert "'second' was not halted" in done.stderr
        with o80.Frontend("second") as second:
            assert second.halted is None
        run_o80("halt", arm.segment, "the", "second", "one")
        run_o80("halt", arm.segment, arm.segment)


def test_o80_halt_all_halts_the_others_when_one_cannot_be_halted(
    arm: o80.Frontend, tmp_path: Path
) -> None:
    directory = Path(os.environ["O80_DIRECTORY"])
    wrong = directory / "o80-aaa"  # the first in the list
    wrong.write_bytes(b"no segment")
    try:
        done = run_o80("halt", "--all", "die", "Tür", "--now", code=1)
    finally:
        wrong.unlink()
    assert "'aaa'" in done.stderr
    assert f"halt 1 of {arm.segment}" in done.stdout
    assert arm.halted is not None
    assert arm.halted.text == "die Tür --now"
