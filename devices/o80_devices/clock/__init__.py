"""Maps a sensor's time stamps to capture times on the clock of this machine."""

from o80_devices.clock.clock_map import Capture, ClockMap

__all__ = ["Capture", "ClockMap"]
