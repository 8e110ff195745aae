"""The benchmark of the scaling over Ray's actors prints figures on four processors or more."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from ray_cluster import SETTINGS

BENCHMARK = Path(__file__).resolve().parents[2] / "benchmarks" / "rollout_scaling.py"
RUN = """
import os, runpy, sys
os.sched_getaffinity = lambda _: set(range({processors}))
sys.argv = ["rollout_scaling.py", "--rounds", "1", "--steps", "16"]
runpy.run_path({benchmark!r}, run_name="__main__")
"""
"""With a faked number of processors, which decides whether and up to where it measures."""


def printed(processors: int) -> str:
    folder = tempfile.mkdtemp(prefix="ray-", dir="/tmp")  # short: paths of sockets go below it
    try:
        return subprocess.run(
            [sys.executable, "-c", RUN.format(processors=processors, benchmark=str(BENCHMARK))],
            env=os.environ | SETTINGS | {"RAY_TMPDIR": folder, "COLUMNS": "80"},
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        ).stdout
    finally:
        shutil.rmtree(folder, ignore_errors=True)


@pytest.mark.parametrize("processors", [1, 3])
def test_fewer_than_four_processors_are_not_measured(processors: int) -> None:
    assert f"not measured: {processors} processors, 4 are needed" in printed(processors)


@pytest.mark.check
@pytest.mark.timeout(900)
def test_four_processors_are_measured_with_one_two_and_four_actors() -> None:
    pytest.importorskip("ray")
    rows = [line.replace("\u2502", " ").split() for line in printed(4).splitlines()]
    measured = [row for row in rows if row and row[0].isdigit()]
    assert [int(actors) for actors, *_ in measured] == [1, 2, 4]
    for actors, rate, share, _ in measured:
        assert float(rate) > 0
        linear = float(measured[0][1]) * int(actors)
        assert float(share) == pytest.approx(100 * float(rate) / linear, abs=1.5)
