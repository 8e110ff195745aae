"""When a sensor captured a value: stamps of its clock mapped to the clock of this machine."""

from o80_devices.clock.clock_map import Capture, ClockMap

__all__ = ["Capture", "ClockMap"]
