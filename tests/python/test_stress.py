"""The stress benchmark runs and tells what it saw; its figures are not judged here."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.check  # stress-ng and cyclictest; it keeps the machine busy

ROOT = Path(__file__).resolve().parents[2]
BUILT = ROOT / "build" / "dev"
COMMAND = [sys.executable, "benchmarks/stress.py", "--built", str(BUILT), "--readers", "0"]


@pytest.fixture(autouse=True)
def _real_time() -> None:
    """Only where a process may take a real-time priority, and the programs are built."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    except PermissionError:
        pytest.skip("this user may not take a real-time priority")
    if not (BUILT / "bin" / "o80-run").exists():
        pytest.skip("build/dev is not built")


def test_it_measures_both_frequencies_and_draws_them() -> None:
    done = subprocess.run(
        [*COMMAND, "--seconds", "1"], cwd=ROOT, capture_output=True, text=True, timeout=100
    )

    assert done.returncode == 0, done.stdout + done.stderr
    assert "o80, 1000 Hz" in done.stdout
    written = json.loads((ROOT / "build" / "bench" / "stress.json").read_text())
    for run, frequency in zip(written["runs"], (1000, 500), strict=True):
        assert run["frequency"] == frequency
        assert 0.3 * frequency < run["iterations"]
        assert run["loop"] == sorted(run["loop"])
        assert run["cyclictest"] == sorted(run["cyclictest"])
        picture = ROOT / "build" / "bench" / f"stress-{frequency}Hz.png"
        assert picture.read_bytes().startswith(b"\x89PNG")


def children_of(pid: int) -> set[int]:
    try:
        text = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except OSError:
        return set()  # it has ended
    return {grandchild for child in map(int, text) for grandchild in {child, *children_of(child)}}


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_it_leaves_nothing_behind(how: signal.Signals) -> None:
    program = subprocess.Popen(
        [*COMMAND, "--seconds", "60"], cwd=ROOT, stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        # the robot, cyclictest, and stress-ng with its own
        while len(children := children_of(program.pid)) < 8:
            assert program.poll() is None
        program.send_signal(how)
        program.wait(60)
    finally:
        program.kill()
        program.wait()

    assert not {child for child in children if Path(f"/proc/{child}").exists()}
    assert not list(Path(os.environ["O80_DIRECTORY"]).glob(f"o80-stress-*-{program.pid}"))
