"""The package o80-pam: its robot is found by name and keeps what o80 builds on, its README runs."""

import base64
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import o80
import o80_pam
from o80.testing import check_robot
from o80.view.answers import Answers
from o80.view.source_list import SourceList

PACKAGE = Path(__file__).resolve().parents[1]


def test_the_robot_is_found_by_its_name() -> None:
    assert o80_pam.library().is_file()
    assert o80.robots.load("pam").path == o80_pam.library()
    assert ("pam", o80_pam.library()) in [(r.name, r.path) for r in o80.robots.list()]


@pytest.mark.parametrize("muscle", ["linear", "hill"])
def test_it_keeps_what_o80_builds_on(muscle: str) -> None:
    plant = {"dead_time": [0.02] * 4, "friction": [0.5] * 4, "start_noise": 0.01}
    assert check_robot("pam", {"muscle": muscle, **plant}) == []


def test_another_model_of_the_muscles_differs_in_the_first_iteration() -> None:
    with o80.robots.load("pam").inline(muscle="linear") as arm:
        arm.burst(20)
        found = o80.replay(arm, options={"muscle": "hill"}).difference
        assert found is not None
        assert found.iteration <= 1


def printed_by_the_readme(number: int, folder: Path) -> list[str]:
    """Lines that one of its programs prints."""
    programs = re.findall(r"```python\n(.*?)```", (PACKAGE / "README.md").read_text(), re.DOTALL)
    assert len(programs) == 2
    done = subprocess.run(
        [sys.executable, "-c", programs[number]],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_the_first_minute_of_the_readme(tmp_path: Path) -> None:
    names, angle = printed_by_the_readme(0, tmp_path)
    assert names.count("'") == 2 * 8
    assert float(angle.split()[0]) > 0.05


def test_the_model_tells_the_numbers_of_the_arm(tmp_path: Path) -> None:
    (dead_time,) = printed_by_the_readme(1, tmp_path)
    assert [float(each) for each in dead_time.split()] == [0.04, 0.04, 0.02, 0.01]


def test_the_identified_arm_moves_after_its_dead_time_and_against_the_sign_of_joint_1() -> None:
    with o80.robots.load("pam").inline(segment="pam-identified", preset="identified") as arm:
        start = arm.latest()
        arm.add_command("agonist_1", float(start.desired[0]) + 1000.0)
        waited = arm.burst(20).extended["joint_positions"]
        moved = arm.burst(100).extended["joint_positions"]
    np.testing.assert_allclose(waited, start.extended["joint_positions"], atol=1e-6)
    assert moved[0] < start.extended["joint_positions"][0] - 0.05


def test_the_view_draws_the_racket_where_the_arm_says_it_is() -> None:
    with o80.robots.load("pam").inline(segment="pam-drawn") as arm:
        arm.add_command([0, 2, 5, 6], [19000.0, 17000.0, 20000.0, 15000.0], iterations=50)
        arm.burst(200)
        answer = Answers(SourceList([arm.segment]), control=False).look({})
        sensors = arm.latest().extended
    shapes = [geom["shape"] for geom in answer["new"]["scene"]["geoms"]]
    assert shapes.count("ellipsoid") == 1
    *_, forearm = np.frombuffer(base64.b64decode(answer["pose"]), np.float32).reshape(-1, 7)
    w, x, y, z = forearm[3:]
    along = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    assert np.abs(sensors["joint_positions"]).min() > 0.01  # each joint has been moved
    np.testing.assert_allclose(forearm[:3] + 0.37 * along, sensors["racket_position"], atol=1e-5)
