"""Iterations a second of inline groups on two threads, beside plain calls of the same drivers.

For the pneumatic arm and for the twin of the table-tennis experiment, in 64 and in 16 copies. Where
valgrind is installed, also the instructions of an iteration, which do not depend on the load of the
machine.
"""

import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import o80
from o80.base.loop_options import text_of
from o80_table_tennis.rig.ball_records import ball_options
from o80_table_tennis.settings import RigSettings
from o80_table_tennis.world.scene import MODEL
from sampling import built, rounds, sample

COPIES_COUNTED = 4
ITERATIONS = 5  # of a burst
BURSTS = (50, 450)  # the difference is counted: the start of the robots is not


def measure(word: str, robot: str, options: dict[str, Any]) -> None:
    program = built() / "bin" / "o80-bench-groups"
    texts = [f"{name}={text_of(value)}" for name, value in options.items()]
    library = o80.robots.path_of(robot)
    robot_words = [word, str(library), *texts]
    subprocess.run([program, str(rounds()), *robot_words], check=True)
    if shutil.which("valgrind") is None:
        print("without valgrind no instructions are counted", file=sys.stderr)
        return
    for side in ("group", "plain"):
        few, many = (instructions(program, side, bursts, robot_words) for bursts in BURSTS)
        iterations = (BURSTS[1] - BURSTS[0]) * COPIES_COUNTED * ITERATIONS
        sample(f"instructions_{word}_{side}", "instructions", (many - few) / iterations)


def instructions(program: Path, side: str, bursts: int, robot: list[str]) -> int:
    """Instructions of the whole program, in user mode."""
    tool = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null"]
    command = [*tool, str(program), "count", side, str(bursts), *robot]
    ended = subprocess.run(command, check=True, capture_output=True, text=True)
    counted = re.search(r"Collected : (\d+)", ended.stderr)
    assert counted, ended.stderr
    return int(counted[1])


def main() -> None:
    measure("pam", "pam", {})
    settings = RigSettings()
    balls = ball_options()
    measure("twin", "mujoco", {"model": MODEL, "timestep": settings.period, **balls})


if __name__ == "__main__":
    main()
