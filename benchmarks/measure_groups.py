"""Iterations a second of inline groups on two threads, beside plain calls of the same drivers.

For the pneumatic arm and for the twin of the table-tennis experiment, in 64 and in 16 copies.
"""

import subprocess
from typing import Any

import o80
from o80.loop_options import text_of
from o80_table_tennis.rig.ball_records import ball_options
from o80_table_tennis.settings import RigSettings
from o80_table_tennis.world.scene import MODEL
from sampling import built, rounds


def measure(word: str, robot: str, options: dict[str, Any]) -> None:
    program = built() / "bin" / "o80-bench-groups"
    texts = [f"{name}={text_of(value)}" for name, value in options.items()]
    library = o80.robots.path_of(robot)
    subprocess.run([program, str(rounds()), word, library, *texts], check=True)


def main() -> None:
    measure("pam", "pam", {})
    settings = RigSettings()
    balls = ball_options(settings.balls_of(0))
    measure("twin", "mujoco", {"model": MODEL, "timestep": settings.period, **balls})


if __name__ == "__main__":
    main()
