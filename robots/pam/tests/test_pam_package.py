"""The package o80-pam: its robot is found by name, its README runs."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np

import o80
import o80_pam

PACKAGE = Path(__file__).resolve().parents[1]


def test_the_robot_is_found_by_its_name() -> None:
    assert o80_pam.library().is_file()
    assert o80.robots.load("pam").path == o80_pam.library()
    assert ("pam", o80_pam.library()) in [(r.name, r.path) for r in o80.robots.list()]


def test_the_first_minute_of_the_readme(tmp_path: Path) -> None:
    (program,) = re.findall(r"```python\n(.*?)```", (PACKAGE / "README.md").read_text(), re.DOTALL)
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, timeout=60
    )

    assert done.returncode == 0, done.stderr
    names, angle = done.stdout.splitlines()
    assert names.count("'") == 2 * 8
    assert float(angle.split()[0]) > 0.05


def test_the_identified_arm_moves_after_its_dead_time_and_against_the_sign_of_joint_1() -> None:
    with o80.robots.load("pam").inline(segment="pam-identified", preset="identified") as arm:
        start = arm.latest()
        arm.add_command("agonist_1", float(start.desired[0]) + 1000.0)
        waited = arm.burst(20).extended["joint_positions"]
        moved = arm.burst(100).extended["joint_positions"]
    np.testing.assert_allclose(waited, start.extended["joint_positions"], atol=1e-6)
    assert moved[0] < start.extended["joint_positions"][0] - 0.05
