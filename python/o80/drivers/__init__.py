"""Drivers in Python: a class with the methods of a driver becomes a robot.

class Thermometer:
    extended = {"temperature": float}

    def read(self, reading):
        reading.extended["temperature"] = 21.5

`o80 run module:Thermometer` and `o80.robots.load("module:Thermometer")` run it like any robot. The
attributes `actuators`, `dtype`, `extended`, `requests`, `limits`, `rests_at`, `when_idle`, `units`,
`while_halted`, `model` and `joints`, of the class or of the object, describe its rows, as the
arguments of `o80.Backend` do; `gap` is the longest time between two rows that does not halt it [s],
if that is less than by default. A simulation says `simulated = True`: every other driver is of the
world. See docs/drivers/in_python.md.
"""

from o80.drivers.option import Seed, option
from o80.drivers.reading import Desired, Reading

__all__ = ["Desired", "Reading", "Seed", "option"]
