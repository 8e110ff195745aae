"""Sensors and machines of a robot laboratory as robots of o80.

A device is a driver, a segment of its own: `o80 run o80_devices.NAME:Class`. Its rows carry the
time of capture on the monotonic clock of this machine, and the reason when there is no value.
"""

from o80.base.installation import check_version

check_version("o80-devices")
