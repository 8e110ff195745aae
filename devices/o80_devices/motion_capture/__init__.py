"""Motion capture systems as sensors: poses of named subjects, or the reason for a gap.

`Playback` plays recorded frames, `Qualisys` is a client of Qualisys Track Manager, `Watched` uses
the package `motioncapture` for Vicon, OptiTrack and VRPN.
"""

from o80_devices.motion_capture.playback import Playback
from o80_devices.motion_capture.qualisys import Qualisys
from o80_devices.motion_capture.sensor import Reason
from o80_devices.motion_capture.transform import Transform
from o80_devices.motion_capture.watched import Watched

__all__ = ["Playback", "Qualisys", "Reason", "Transform", "Watched"]
