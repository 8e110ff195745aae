"""A launcher of table-tennis balls: `o80 run o80_devices.ball_launcher:BallLauncher`."""

from o80_devices.ball_launcher.driver import BallLauncher
from o80_devices.ball_launcher.launch_model import LAUNCH_MODEL, Launch, LaunchModel
from o80_devices.ball_launcher.launcher import LastLaunch, Status

__all__ = ["LAUNCH_MODEL", "BallLauncher", "LastLaunch", "Launch", "LaunchModel", "Status"]
