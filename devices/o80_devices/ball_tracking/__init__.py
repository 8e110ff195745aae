"""A ball seen by several cameras: images => detection => place in the world => flight.

Its cameras and their rig are in o80_devices.cameras, the calibration of a rig is in
o80_devices.calibration.

| module | what it holds |
|---|---|
| colour.py | the probability that a colour is that of the ball |
| detection.py, flight_track.py | the ball in images; its flight |
| tracker.py | from the images of one moment to the ball, without o80 |
| ball_row.py | what a row of the tracker holds |
| ball_tracker.py | the driver: reads the segments of cameras |
| tracking_server.py, server_messages.py | the driver for a ball tracker that is a server |
| robot_and_ball.py | recordings of robot and ball |
"""

from o80_devices.ball_tracking.ball_row import Reason
from o80_devices.ball_tracking.ball_tracker import BallTracker
from o80_devices.ball_tracking.tracker import Tracker
from o80_devices.cameras.genicam_cameras import GenicamCameras
from o80_devices.cameras.rig import Rig, RigCamera, four_cameras
from o80_devices.cameras.synthetic_cameras import SyntheticCameras
from o80_devices.cameras.video_cameras import VideoCameras

__all__ = [
    "BallTracker",
    "GenicamCameras",
    "Reason",
    "Rig",
    "RigCamera",
    "SyntheticCameras",
    "Tracker",
    "VideoCameras",
    "four_cameras",
]
