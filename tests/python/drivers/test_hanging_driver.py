"""Texts of `o80 list` and `o80 info` about robots whose driver hangs or is late."""

import contextlib
import os
import signal
import subprocess
import sysconfig
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from processes import O80, WAIT, Running, run_o80, until
from room_sensor import Silent

import o80


def line_with(text: str, process: Running) -> str:
    """The first line with this text that the process prints on its standard error."""
    for line in process.stderr:
        if text in line:
            return line
    raise AssertionError(f"it ended without a line with '{text}'")


Hang = Callable[[str], Running]


@pytest.fixture
def hang(segment: str) -> Iterator[Hang]:
    """Starts a robot that hangs in a verb."""
    command = [O80, "run", "room_sensor:Hanging", "--segment", segment, "--verb"]
    here = Path(__file__).parents[1]
    with contextlib.ExitStack() as started:
        yield lambda verb: started.enter_context(Running(*command, verb, cwd=here))
    o80.clean(segment)


def until_said(text: str, *command: str) -> str:
    """Asks again and again until the answer has the text."""
    return until(lambda: said if text in (said := run_o80(*command, code=None).stdout) else "")


def test_a_start_that_does_not_return_is_listed(segment: str, hang: Hang) -> None:
    process = hang("start")

    answer = until_said(f"{segment}: start() of the driver has been running for", "list")

    assert "hangs" in answer
    line_with("start() of the driver has been running for", process)
    with pytest.raises(o80.TimeoutError, match=r"still starting: start\(\) of its driver"):
        o80.Frontend(segment, timeout=0.0)


def test_a_verb_that_does_not_return_is_listed_and_so_are_missing_rows(
    segment: str, hang: Hang
) -> None:
    process = hang("write")

    answer = until_said("no row for", "list")
    assert f"{segment}: no row for" in answer
    assert "write() of the driver has been running for" in answer
    assert "hangs" in answer

    answer = until_said("no row for", "info", segment)
    assert "write() of the driver has been running for" in answer
    with o80.Frontend(segment, read_only=True, timeout=WAIT) as frontend:
        assert "write() of the driver" in frontend.trouble
        assert frontend.slow_verb is not None
        assert frontend.slow_verb[0] == "write"
        assert frontend.rate_reached == 0.0
        assert frontend.row_age is not None
        assert frontend.row_age > 1.0
    assert "write() of the driver has been running for" in line_with("no row for", process)


def test_a_library_with_an_undefined_function_is_told_its_name(tmp_path: Path) -> None:
    library = tmp_path / "undefined.so"
    compiler = (sysconfig.get_config_var("CXX") or "g++").split()[0]
    subprocess.run(
        [compiler, "-shared", "-fPIC", "-xc++", "-", "-o", library],
        input='double torque(int joint);\nextern "C" double read() { return torque(1); }\n',
        text=True,
        check=True,
    )

    with pytest.raises(o80.DriverError, match=r"'torque\(int\)', which is not defined"):
        o80.robots.load(library)


# rule W8
def test_a_robot_that_says_nothing_of_itself_is_guarded_as_hardware(segment: str) -> None:
    """In real time it is halted after a gap, and is not resumed where it cannot have come."""
    with o80.robots.load(Silent).start(segment) as process, process.frontend() as arm:
        arm.add_command(0, 0.5, iterations=10_000_000)
        batch = arm.pulse()
        arm.wait_for(3, timeout=WAIT)
        os.kill(process.pid, signal.SIGSTOP)
        time.sleep(1.0)  # what is tested, not a wait
        os.kill(process.pid, signal.SIGCONT)
        with pytest.raises(o80.BackendHalted, match=r"no iteration for \d.*than --gap 0\.1 s:"):
            batch.wait(WAIT)
        halt = arm.halted
        assert halt is not None
        arm.wait_for(arm.published + 100, timeout=WAIT)
        with pytest.raises(o80.Error, match=r"was read at 30 after 0.*--accept-reading"):
            arm.resume(halt.number)


def test_late_iterations_are_listed_with_the_rate_that_is_reached(segment: str, hang: Hang) -> None:
    process = hang("late")

    until_said("Hz reached of 1000", "list")
    answer = until_said("Hz reached of 1000", "info", segment)

    assert "iterations were late" in answer
    assert "iterations were late" in line_with("Hz reached of 1000", process)
