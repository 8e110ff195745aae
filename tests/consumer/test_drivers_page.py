"""The driver of docs/drivers.md builds, runs and obeys as the page says."""

import re
import subprocess
import sys
from pathlib import Path

import o80

ROOT = Path(__file__).resolve().parent.parent.parent
PAGE = (ROOT / "docs" / "drivers.md").read_text()
TYPES = (ROOT / "docs" / "drivers" / "which_type.md").read_text()


def first_block(language: str, page: str = PAGE) -> str:
    found = re.search(rf"```{language}\n(.*?)```", page, re.DOTALL)
    assert found
    return found[1]


def run(*command: str, folder: Path) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_complete_driver_is_built_and_commanded_as_shown(tmp_path: Path) -> None:
    (tmp_path / "arm.cpp").write_text(first_block("cpp"))
    (tmp_path / "CMakeLists.txt").write_text(first_block("cmake"))
    run("cmake", "-B", "build", f"-Do80_ROOT={o80.prefix()}", folder=tmp_path)
    run("cmake", "--build", "build", folder=tmp_path)
    robot = o80.robots.load(tmp_path / "build" / "arm.so")
    with robot.start(frequency=500, gain=30.0, gap=0) as process:
        printed = run(sys.executable, "-c", first_block("python"), folder=tmp_path)
        assert "0.49" in printed or "0.5" in printed
        process.wait(timeout=20.0)


def test_the_groups_of_the_page_about_types_are_commanded_apart(tmp_path: Path) -> None:
    driver = """
struct Arm {
  struct Config { double gain = 1; };
  using Actuators = Commanded;
  explicit Arm(const Config&) {}
  void start() {}
  void write(const o80::Desired<Arm>& desired) { now = desired.states; }
  void read(o80::Reading<Arm>& reading) { reading.observed = now; }
  void stop() noexcept {}
  Commanded now{};
};
O80_DESCRIBE(Arm::Config, (gain, "of nothing"));
O80_ROBOT(arm, Arm)
"""
    groups = '#include <array>\n#include "o80/robot.hpp"\n' + first_block("cpp", TYPES)
    (tmp_path / "arm.cpp").write_text(groups + driver)
    (tmp_path / "CMakeLists.txt").write_text(first_block("cmake"))
    run("cmake", "-B", "build", f"-Do80_ROOT={o80.prefix()}", folder=tmp_path)
    run("cmake", "--build", "build", folder=tmp_path)
    with o80.robots.load(tmp_path / "build" / "arm.so").inline() as arm:
        arm.add_command("joints", [0.1] * 6, iterations=10)
        arm.burst(5)
        arm.add_command("torques", [0.5] * 6)
        row = arm.burst(5)
        assert row.observed.joints.tolist() == [0.1] * 6
        assert row.observed.torques.tolist() == [0.5] * 6
        assert (float(row.observed.gripper), arm.actuators[0].name) == (0.0, "joints_0")
