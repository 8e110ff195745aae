"""Backends that are stopped by their name."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from processes import WAIT, run_o80

import o80


def test_a_backend_that_does_not_stop_in_time_is_told_of(segment: str) -> None:
    program = (
        "import signal, o80\n"
        "signal.signal(signal.SIGTERM, signal.SIG_IGN)\n"
        f"backend = o80.Backend({segment!r}, ['a'])\n"
        "backend.publish([0.0])\n"
        "print('ready', flush=True)\n"
        "signal.pause()\n"
    )
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE) as deaf:
        assert deaf.stdout is not None
        assert deaf.stdout.readline() == b"ready\n"
        with pytest.raises(o80.TimeoutError, match=f"kill -9 {deaf.pid}"):
            o80.stop(segment, timeout=0.0)
        deaf.kill()


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
