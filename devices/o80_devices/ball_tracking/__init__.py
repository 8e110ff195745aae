"""A ball seen by several cameras: images => detection => place in the world => flight.

| module | what it holds |
|---|---|
| rig.py | where the cameras are, and what they see of the world |
| colour.py | the probability that a colour is that of the ball |
| tracker.py | from the images of one moment to the ball, without o80 |
| ball_row.py | what a row of the tracker holds |
| ball_tracker.py | the driver: reads the segments of cameras |
| scene.py, throws.py | a synthetic camera, and the flights that it sees |
| synthetic_cameras.py, video_cameras.py, genicam_cameras.py | drivers of cameras |
| aravis.py, newest_image.py, pixel_formats.py | what GenICam cameras need |
| calibrate.py | the command that calibrates a rig |
| board.py, lenses.py | intrinsics from a chessboard |
| waved_ball.py, table_corners.py | what extrinsics are found from |
| calibration.py, bundle.py, world_frame.py | extrinsics |
"""

from o80_devices.ball_tracking.ball_row import Reason
from o80_devices.ball_tracking.ball_tracker import BallTracker
from o80_devices.ball_tracking.genicam_cameras import GenicamCameras
from o80_devices.ball_tracking.rig import Rig, RigCamera, four_cameras
from o80_devices.ball_tracking.synthetic_cameras import SyntheticCameras
from o80_devices.ball_tracking.tracker import Tracker
from o80_devices.ball_tracking.video_cameras import VideoCameras

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
