"""Robot libraries, which run in a process of their own or in this one.

with o80.robots.load("two_joints").start(frequency=500, gain=2.0) as process:
    arm = process.frontend()

with o80.robots.load("two_joints").inline() as arm:
    arm.burst(5)
"""

from o80.robots.process import Process
from o80.robots.robot import Option, Robot, RobotFile, list, load, path_of

__all__ = ["Option", "Process", "Robot", "RobotFile", "list", "load", "path_of"]
