"""The programs of the README and of docs/drivers.md run as they stand there."""

import re
import subprocess
import sys
from pathlib import Path

import o80

ROOT = Path(__file__).resolve().parent.parent.parent
README = (ROOT / "README.md").read_text()
DRIVERS = (ROOT / "docs" / "drivers.md").read_text()
TYPES = (ROOT / "docs" / "drivers" / "which_type.md").read_text()


def blocks(language: str, page: str = README) -> list[str]:
    """The code blocks of a language, in order."""
    return re.findall(rf"```{language}\n(.*?)```", page, re.DOTALL)


def run(*command: str, folder: Path) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_ten_lines_of_python(tmp_path: Path) -> None:
    (program,) = blocks("python")
    desired, rows, time = run(sys.executable, "-c", program, folder=tmp_path).splitlines()
    assert desired.startswith("[0.1")
    assert (rows, time) == ("(100, 2)", "0.1 s")


def test_the_names_that_a_user_needs() -> None:
    (sentence,) = re.findall(r"needs twelve names of `o80`: (.*)", README)
    names = re.findall(r"`(\w+)`", sentence)
    assert len(names) == 12
    assert not [name for name in names if not hasattr(o80, name)]


def test_is_short_and_its_film_loads_fast() -> None:
    assert len(README.splitlines()) <= 110
    (film,) = re.findall(r"\((docs/pictures/\S+\.gif)\)", README)
    assert (ROOT / film).stat().st_size < 3e6


def test_the_robot_in_cpp(tmp_path: Path) -> None:
    (source,) = blocks("cpp")
    (lists,) = blocks("cmake")
    (tmp_path / "wheels.cpp").write_text(source)
    (tmp_path / "CMakeLists.txt").write_text(lists)
    run("cmake", "-B", "build", f"-Do80_ROOT={o80.prefix()}", folder=tmp_path)
    run("cmake", "--build", "build", folder=tmp_path)
    robot = o80.robots.load(tmp_path / "build" / "wheels.so")
    with robot.start(gain=0.2, gap=0) as process, process.frontend() as wheels:
        wheels.add_command(0, {"speed": 1.0}, duration=0.1)
        assert wheels.pulse_and_wait(timeout=20.0).desired["speed"][0] == 1.0
        wheels.add_command(0, {"speed": 1.0}, duration=100.0)
        wheels.pulse()
        wheels.halt("a wall")
        halted = wheels.wait_for(wheels.published + 10, timeout=20.0)
        assert halted.desired["speed"][0] == 0.0


def test_the_complete_driver_is_built_and_commanded_as_shown(tmp_path: Path) -> None:
    (tmp_path / "arm.cpp").write_text(blocks("cpp", DRIVERS)[0])
    (tmp_path / "CMakeLists.txt").write_text(blocks("cmake", DRIVERS)[0])
    run("cmake", "-B", "build", f"-Do80_ROOT={o80.prefix()}", folder=tmp_path)
    run("cmake", "--build", "build", folder=tmp_path)
    robot = o80.robots.load(tmp_path / "build" / "arm.so")
    with robot.start(frequency=500, gain=30.0, gap=0) as process:
        printed = run(sys.executable, "-c", blocks("python", DRIVERS)[0], folder=tmp_path)
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
    groups = '#include <array>\n#include "o80/robot.hpp"\n' + blocks("cpp", TYPES)[0]
    (tmp_path / "arm.cpp").write_text(groups + driver)
    (tmp_path / "CMakeLists.txt").write_text(blocks("cmake", DRIVERS)[0])
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
