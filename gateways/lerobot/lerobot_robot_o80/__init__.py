"""Robots of o80 for LeRobot: `--robot.type=o80 --robot.segment=so101`, `--teleop.type=o80 ...`.

LeRobot's programs import this package by name and load both classes from it. See docs/lerobot.md.
"""

from o80.base.installation import check_version

check_version("lerobot_robot_o80")

from lerobot_robot_o80.robot import O80, O80Config  # noqa: E402
from lerobot_robot_o80.teleoperator import O80Teleop, O80TeleopConfig  # noqa: E402

__all__ = ["O80", "O80Config", "O80Teleop", "O80TeleopConfig"]
