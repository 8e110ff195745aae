"""Findings of a type checker in users' programs."""

import fcntl
import subprocess
import sys
from pathlib import Path

import pytest

GOOD = """
from collections.abc import Mapping
from typing import Any, assert_type

import numpy as np
import o80
from numpy.typing import NDArray


def use(arm: o80.Frontend) -> float:
    arm.add_command("elbow", 0.5, duration=2.0, mode="overwrite", profile=o80.Profile.MINIMUM_JERK)
    arm.add_command(["shoulder", "elbow"], [0.1, 0.2], start="observed", every=0.02)
    arm.add_trajectory(np.zeros((5, 2)), mode=o80.Mode.QUEUE, profile="linear")
    assert_type(arm.pulse(at=7, late="now"), o80.Batch)
    observation = arm.pulse_and_wait(timeout=5.0)
    assert_type(observation, o80.Observation)
    assert_type(observation.observed, o80.States)
    assert_type(observation.desired, o80.States)
    joints: NDArray[Any] = observation.observed.joints["position"]
    position: NDArray[Any] = observation.observed["position"]
    gripper: NDArray[Any] = observation.observed.gripper
    numbers: NDArray[Any] = observation.observed * 2 + observation.desired
    assert_type(observation.active, NDArray[np.bool_])
    assert_type(observation.extended, o80.Record)
    force: NDArray[Any] = observation.extended.force
    assert_type(observation.iteration, int)
    history = arm.history(seconds=2.0)
    assert_type(history, o80.History)
    assert_type(arm.history(5, fields="observed"), NDArray[Any])
    assert_type(arm.history(since=5, fields=["time", "observed"]), tuple[NDArray[Any], ...])
    assert_type(history.observed, o80.States)
    first: NDArray[Any] = history.observed["position"][:, 0]
    assert_type(history.time, NDArray[np.int64])
    assert_type(history[3], o80.Observation)
    assert_type(history[3:], o80.History)
    assert_type(history.at_iteration(5), o80.Observation)
    assert_type(history.select(from_time=0), o80.History)
    assert_type(arm.at_time(10), o80.Observation)
    for row in arm.stream(timeout=1.0):
        assert_type(row, o80.Observation)
    assert_type(arm.burst(5), o80.Observation)
    assert_type(arm.burst(5, wait=False), o80.Burst)
    assert_type(arm.halted, o80.Halt | None)
    rows = o80.wait_for_first([arm])
    assert_type(rows, dict[o80.Frontend, o80.Observation])
    arm.add_command("elbow", {"position": 1.0}, until=3)
    with o80.robots.load("two_joints").start(frequency=500.0, gain=2.0) as process:
        assert_type(process.frontend(), o80.Frontend)
    assert_type(o80.burst({arm: 3}), dict[o80.Frontend, o80.Observation])
    return float(position[0] + gripper + force[0] + first.sum() + numbers[0] + joints[0])


async def wait(arm: o80.Frontend) -> None:
    assert_type(await arm.pulse(), o80.Batch)
    assert_type(await arm.burst(3, wait=False), o80.Observation)
    assert_type(await arm.aio.wait_for_next(timeout=1.0), o80.Observation)
    async for row in arm.stream():
        assert_type(row, o80.Observation)
"""

BAD = [
    ("arm.add_command(0, 0.5, mode='overwritten')", "overwritten"),
    ("arm.add_command(0, 0.5, profile='smooth')", "smooth"),
    ("arm.add_command(0, 0.5, start='now')", "start"),
    ("arm.add_command(0, 0.5, every='often')", "every"),
    ("arm.add_command(0, 0.5, 2.0)", "Too many positional arguments"),
    ("arm.add_command(0, 0.5, seconds=2.0)", 'Unexpected keyword argument "seconds"'),
    ("arm.pulse(late='never')", "late"),
    ("arm.latest().observe", 'has no attribute "observe"'),
    ("o80.Frontend('arm', on_error='ignore')", "on_error"),
    ("o80.Backend('arm', stale='wait')", "stale"),
    ("o80.Backend('arm', when_idle='rest')", "when_idle"),
    ("number: str = arm.latest().observed['position']", "Incompatible types"),
    ("joints: str = arm.latest().observed.joints['position']", "Incompatible types"),
    ("many: str = arm.history(3).observed['position']", "Incompatible types"),
    ("force: str = arm.latest().extended.force", "Incompatible types"),
    ("arm.history(since=1.5)", "history"),
    ("arm.add_command(0.5, 0.5)", "add_command"),
    ("o80.Mode.REPLACE", "REPLACE"),
    ("arm.pulse_and_wait(timeout='5')", "timeout"),
]


def mypy(folder: Path, *programs: str) -> list[list[str]]:
    """Findings of mypy, as strict as it gets, in each program: lines without the file's name."""
    files = [folder / f"program{number}.py" for number in range(len(programs))]
    for file, program in zip(files, programs, strict=True):
        file.write_text(program)
    cache = Path(__file__).parents[2] / "build" / "mypy-users"
    command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(cache)]
    cache.parent.mkdir(exist_ok=True)
    # one at a time: the first reads NumPy, which takes long, and leaves what it read to the others
    with cache.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        # no settings of this repository: a user has others
        run = subprocess.run(
            [*command, "--config-file", "", *map(str, files)],
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
        )
    assert run.stdout.rstrip().endswith(("source files)", "source file)", "no issues found")), run
    return [
        [
            line.removeprefix(f"{file.name}:")
            for line in run.stdout.splitlines()
            if file.name in line
        ]
        for file in files
    ]


def test_understands_the_program_of_a_user_and_finds_wrong_words_and_names(tmp_path: Path) -> None:
    lines = [call for call, _ in BAD]
    program = "import o80\n\n\ndef use(arm: o80.Frontend) -> None:\n"
    program += "".join(f"    {line}\n" for line in lines)
    good, bad = mypy(tmp_path, GOOD, program)
    assert not good
    for number, (call, word) in enumerate(BAD, start=5):
        found = [line for line in bad if line.startswith(f"{number}: error")]
        assert any(word in line for line in found), (call, bad)


@pytest.mark.parametrize("state", ["observed", "desired"])
def test_states_are_arrays_or_records_at_run_time(state: str) -> None:
    import o80

    with o80.robots.load("two_joints").inline() as arm:
        assert isinstance(getattr(arm.latest(), state), o80.States)
        assert isinstance(getattr(arm.history(), state), o80.States)
