"""Failures and what the arm then does: the rows of docs/safety.md that need whole processes."""

import asyncio
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from manual_backend import ManualBackend
from processes import O80, WAIT, Running, run_o80, run_program, until

import o80

ROOT = Path(__file__).resolve().parents[3]


def start(segment: str, **options: object) -> o80.robots.Process:
    return o80.robots.load("two_joints").start(segment, **options)  # type: ignore[arg-type]


# ------------------------------------------------------------------------------ ends of the process


@pytest.fixture
def terminal_that_may_close() -> Iterator[None]:
    """Also where the tests themselves were started with nohup, which children inherit."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.mark.usefixtures("terminal_that_may_close")
@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGTERM, signal.SIGINT])
def test_signals_stop_in_order(segment: str, number: signal.Signals) -> None:
    process = start(segment)
    with process.frontend() as arm:
        arm.add_command(0, 3.0, iterations=10**9)
        batch = arm.pulse()
        until(lambda: batch.handles[0].status == "active")
        os.kill(process.pid, number)
        with pytest.raises(o80.BackendStopped):
            arm.wait_for(10**12, timeout=WAIT)
        handle = batch.handles[0]
        assert (handle.status, handle.reason) == ("purged", "stopped")
    process.wait(WAIT)


def test_a_robot_whose_output_nobody_reads_lives_on(segment: str) -> None:
    words = [O80, "run", "two_joints", "--segment", segment]
    with Running(*words, stderr=subprocess.STDOUT) as program:
        program.stdout.readline()
        program.stdout.close()  # the terminal is gone, nobody was told
        with o80.Frontend(segment, timeout=WAIT) as arm:
            number = arm.halt("said on the closed output")
            until(lambda: arm.latest().halted)
            until(lambda: arm.published > 3000)  # a line was due
            arm.resume(number)


def test_a_robot_started_with_nohup_goes_on_when_the_terminal_closes(segment: str) -> None:
    with (
        Running("nohup", O80, "run", "two_joints", "--segment", segment) as program,
        o80.Frontend(segment, timeout=WAIT) as arm,
    ):
        program.send_signal(signal.SIGHUP)
        arm.add_command(0, 0.1, iterations=50)
        assert arm.pulse_and_wait(timeout=WAIT).desired[0] == 0.1
        assert arm.halted is None


FULL_DIRECTORY = """
import errno, os, subprocess, sys
import o80
directory = sys.argv[1]
subprocess.run(["mount", "-t", "tmpfs", "-o", "size=96m", "o80", directory], check=True)
os.environ["O80_DIRECTORY"] = directory
with o80.robots.load("two_joints").start("arm") as process, process.frontend() as arm:
    filler = os.open(directory + "/filler", os.O_CREAT | os.O_WRONLY)
    try:
        while True:
            os.write(filler, bytes(1 << 12))
    except OSError as error:
        assert error.errno == errno.ENOSPC, error
    arm.add_command(0, 0.1, iterations=20)
    assert arm.pulse_and_wait(timeout=60).desired[0] == 0.1
    number = arm.halt("the directory is full")
    while not arm.latest().halted:
        arm.wait_for(arm.published + 1, timeout=60)
    arm.resume(number, timeout=60)
    try:
        o80.robots.load("two_joints").start("other")
    except o80.Error as error:
        print("refused:", error)
"""


def test_a_robot_goes_on_when_the_directory_is_full_and_a_second_one_is_refused(
    tmp_path: Path,
) -> None:
    apart = ["unshare", "--mount", "--propagation", "private"]
    if subprocess.run([*apart, "true"], capture_output=True).returncode != 0:
        pytest.skip("this user may not mount a small file system")

    done = run_program(*apart, sys.executable, "-c", FULL_DIRECTORY, tmp_path, timeout=2 * WAIT)

    assert "refused: " in done.stdout
    assert "has no room" in done.stdout


def test_a_supervisor_may_resume_on_purpose(segment: str) -> None:
    process = start(segment)
    with process.frontend() as arm:
        arm.halt("before")
        until(lambda: arm.latest().halted)
        os.kill(process.pid, signal.SIGKILL)
        with pytest.raises(o80.BackendKilled):
            arm.wait_for(10**12, timeout=WAIT)
    with start(segment, resume=True) as successor, successor.frontend() as arm:
        assert arm.halted is None


# ------------------------------------------------------------------------------ the verbs of a halt


def test_an_embedded_backend_halts_and_resumes(segment: str) -> None:
    told = []
    refuse = ["the door is open"]

    def resume() -> None:
        if refuse:
            raise o80.RequestRejected(refuse.pop())

    requests: dict[str, None] = {"see": None, "go": None}
    with ManualBackend(segment, 2, requests=requests, while_halted=["see"]) as robot:
        backend, arm = robot.backend, robot.frontend
        backend.on_halt(lambda: told.append("halt"))
        backend.on_resume(resume)
        for name in requests:
            backend.on(name, lambda _: None)
        backend.halt("from inside")
        robot.run()
        halt = arm.halted
        assert halt is not None
        assert (halt.cause, halt.text, told) == ("driver", "from inside", ["halt"])
        for name, status in (("see", "completed"), ("go", "rejected")):
            arm.add_request(name)
            batch = arm.pulse()
            robot.run()
            assert batch.handles[0].status == status
        for refused in (True, False):  # by the handler
            with pytest.raises(o80.TimeoutError):
                arm.resume(timeout=0)
            robot.run()
            assert (arm.halted is not None) == refused


@pytest.mark.parametrize("value", [False, "no", 7])
@pytest.mark.parametrize("verb", ["on_halt", "on_resume"])
def test_what_a_handler_of_a_halt_returns_is_checked(
    segment: str, verb: str, value: object
) -> None:
    with o80.Backend(segment, 1) as backend:
        getattr(backend, verb)(lambda: value)
        backend.publish([0.0])
        backend.halt("test")
        text = rf"the handler of {verb} must return None.*got {value!r}"
        if verb == "on_resume":
            backend.step()
            backend.publish()
            with o80.Frontend(segment) as arm, pytest.raises(o80.TimeoutError):
                arm.resume(timeout=0)
        with pytest.raises(o80.InvalidArgument, match=text):
            backend.step()


# ------------------------------------------------------------------------------ the program o80


def test_the_program_halts_shows_and_resumes(process: o80.robots.Process, segment: str) -> None:
    assert f"o80 resume {segment} 1" in run_o80("halt", segment, "lunch break").stdout
    with process.frontend() as arm:
        until(lambda: arm.latest().halted)
    for words in (["list"], ["info", segment]):
        assert "lunch break" in run_o80(*words).stdout
    assert "HALTED" in run_o80("echo", segment, "--count", "1").stdout
    assert "resumed" in run_o80("resume", segment).stdout
    assert "not halted" in run_o80("resume", segment).stdout
    assert "lunch break" not in run_o80("list").stdout


# ------------------------------------------------------------------------------ the page


def test_every_row_of_the_page_names_tests_that_exist() -> None:
    page = (ROOT / "docs" / "safety.md").read_text()
    _, _, table = page.partition("## What can fail")
    rows = [line for line in table.splitlines() if line.startswith("| ") and "`" in line]
    sources = "\n".join(
        path.read_text()
        for pattern in ("cpp/**/*.cpp", "python/**/*.py", "processes/*.py")
        for path in ROOT.glob(f"tests/{pattern}")
    )
    assert len(rows) >= 12
    for row in rows:
        tests = re.findall(r"`(\w+\.\w+|test_\w+)`", row.split(" | ")[-1])
        assert tests, row
        for name in tests:
            suite, dot, case = name.partition(".")
            written = f"({suite}, {case})" if dot else f"def {name}("
            assert written in sources, name


def test_a_resume_says_whether_there_was_a_halt(arm: o80.Frontend) -> None:
    assert arm.resume() is False
    assert arm.resume(7) is False
    number = arm.halt()
    assert arm.resume(number) is True
    assert asyncio.run(arm.aio.resume()) is False


# ---------------------------------------------------------------------------- stopped by their name


def test_a_backend_that_does_not_stop_in_time_is_told_of(segment: str) -> None:
    program = (
        "import signal, o80\n"
        "signal.signal(signal.SIGTERM, signal.SIG_IGN)\n"
        f"backend = o80.Backend({segment!r}, ['a'])\n"
        "backend.publish([0.0])\n"
        "print('ready', flush=True)\n"
        "signal.pause()\n"
    )
    with Running(sys.executable, "-c", program) as deaf:
        assert deaf.stdout.readline() == "ready\n"
        with pytest.raises(o80.TimeoutError, match=f"kill -9 {deaf.pid}"):
            o80.stop(segment, timeout=0.0)


@pytest.fixture
def reused(process: o80.robots.Process, segment: str) -> o80.robots.Process:
    """A robot whose segment bears the process id of another, later process."""
    file = Path(os.environ["O80_DIRECTORY"], f"o80-{segment}")
    content = file.read_bytes()
    entry = next(entry for entry in o80.segments() if entry.name == segment)
    where = content.index(entry.process_start.to_bytes(8, "little"))
    with file.open("r+b") as header:
        header.seek(where)
        header.write((entry.process_start - 1).to_bytes(8, "little"))
    return process


def test_a_process_that_only_has_the_id_of_the_backend_is_not_signalled(
    reused: o80.robots.Process, segment: str
) -> None:
    with pytest.raises(o80.SegmentError, match=f"process {reused.pid} is not the one"):
        o80.stop(segment)

    with reused.frontend() as arm:
        assert arm.wait_for(arm.published + 20, timeout=WAIT)
    assert reused.alive


def test_the_command_line_stops_the_others_when_one_does_not_run(
    process: o80.robots.Process, segment: str
) -> None:
    stopped = run_o80("stop", "arm", segment, code=1)
    assert "no backend 'arm' runs" in stopped.stderr
    assert f"{segment} has stopped" in stopped.stdout
    assert process.wait(WAIT) == 0
