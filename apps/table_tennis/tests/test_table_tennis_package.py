"""The package o80-table-tennis: its program, what its import says when something is missing."""

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.parametrize("robot", ["mujoco", "pam"])
def test_without_a_robot_the_import_says_what_to_install(robot: str) -> None:
    program = f"import sys; sys.modules['o80_{robot}'] = None; import o80_table_tennis"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)

    assert done.returncode != 0
    assert f'pip install "o80-{robot}"' in done.stderr


def test_the_program_says_what_it_does() -> None:
    program = Path(sys.executable).parent / "o80-table-tennis"
    done = subprocess.run([program, "--help"], capture_output=True, text=True)

    assert done.returncode == 0, done.stderr
    assert "Plays table tennis in real time, then accelerated" in done.stdout


def test_the_program_is_a_demo_of_o80() -> None:
    o80 = Path(sys.executable).parent / "o80"
    words = ("demo", "table_tennis", "--episodes", "0", "--real-time-episodes", "0")
    done = subprocess.run([o80, *words], capture_output=True, text=True)

    assert "nothing to play: ask for at least one episode" in done.stderr
    assert "o80 demo table_tennis" in done.stderr
