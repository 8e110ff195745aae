"""The driver of docs/drivers.md builds, runs and obeys as the page says."""

import re
import subprocess
import sys
from pathlib import Path

import o80

ROOT = Path(__file__).resolve().parent.parent.parent
PAGE = (ROOT / "docs" / "drivers.md").read_text()


def first_block(language: str) -> str:
    found = re.search(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)
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
