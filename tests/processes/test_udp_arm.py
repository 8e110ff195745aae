"""The arm over UDP of examples/udp_arm as processes: a robot that paces the loop, and its fake."""

import contextlib
import os
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import o80

WAIT = 60.0  # [s] longer than any wait should take
NEVER = "1000000"  # ticks: a busy machine is no reason for a halt
PATIENT = "6000"  # ticks without a reading, for the same reason


@pytest.fixture
def segment() -> str:
    """A name of this session; `robot` removes what is left of it."""
    return f"test-{os.getpid()}-udp-arm"


@dataclass
class Fake:
    """The arm's side, as a process."""

    process: subprocess.Popen[str]
    port: str

    def says(self, words: str) -> None:
        """Waits for a line that holds these words."""
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if words in line:
                return
        pytest.fail(f"the fake arm ended before it said '{words}'")


@contextmanager
def fake_arm(prefix: Path, *options: str) -> Iterator[Fake]:
    command = [str(prefix / "bin" / "fake_arm"), "--port", "0", "--timeout", NEVER, *options]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        yield Fake(process, process.stdout.readline().strip().rpartition(":")[2])
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


@contextmanager
def robot(prefix: Path, segment: str, fake: Fake, *options: str) -> Iterator[subprocess.Popen[str]]:
    command = [
        str(prefix / "bin" / "o80-run"), str(prefix / "lib" / "examples" / "udp_arm.so"),
        "--segment", segment, "--frequency", "100", "--port", fake.port, "--gap", "0", *options,
    ]  # fmt: skip
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate()
        with contextlib.suppress(o80.Error):
            o80.clean(segment)


def moved(arm: o80.Frontend) -> None:
    """Moves the arm there and back, the arm itself included."""
    for target in (0.2, 0.0):
        arm.add_command(None, [target] * 6, fastest=True)
        arm.pulse_and_wait(timeout=WAIT)
        end = time.monotonic() + WAIT
        while np.abs(arm.latest().observed - target).max() > 1e-3:
            assert time.monotonic() < end
            arm.wait_for_next(timeout=WAIT)


def resumed(arm: o80.Frontend) -> None:
    """Resumes as an operator would: again, until the arm is ready."""
    end = time.monotonic() + WAIT
    while (halt := arm.halted) is not None:
        assert time.monotonic() < end
        with contextlib.suppress(o80.Error):
            arm.resume(halt.number, timeout=1.0)


def test_a_restart_of_the_arm_halts_the_robot_and_resume_goes_on(
    build_prefix: Path, segment: str
) -> None:
    with (
        fake_arm(build_prefix, "--faults", "restart 50-90") as fake,
        robot(build_prefix, segment, fake, "--tolerated", PATIENT),
        o80.Frontend(segment) as arm,
    ):
        end = time.monotonic() + WAIT
        while arm.latest().extended["restarts"] == 0:
            assert time.monotonic() < end
            arm.wait_for_next(timeout=WAIT)
        arm.wait_for_next(timeout=WAIT)
        halt = arm.halted
        assert halt is not None
        assert halt.cause == "driver"
        assert "the arm" in halt.text
        arm.add_command("joint1", 0.1, duration=0.1)
        batch = arm.pulse()
        with pytest.raises(o80.BackendHalted, match="the arm"):
            batch.wait(WAIT)
        assert batch.statuses == [o80.Status.REJECTED]
        resumed(arm)
        moved(arm)


def test_an_arm_that_does_not_answer_is_refused_at_the_start(
    build_prefix: Path, segment: str
) -> None:
    with fake_arm(build_prefix) as fake:
        fake.process.kill()
        fake.process.wait()
        with robot(build_prefix, segment, fake) as process:
            _, said = process.communicate(timeout=WAIT)
            assert process.returncode == 1
            assert "is the arm switched on" in said
