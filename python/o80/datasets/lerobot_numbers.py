"""Names and scales a robot's numbers as LeRobot does: "elbow_flex.pos" in degrees."""

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from o80.base.errors import InvalidArgument
from o80.rows.actuators import actuators_of
from o80.rows.columns import Column, chosen, columns_of_part

Units = Literal["degrees", "normalised", "native"]
JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
"""Names of the actuators of the arms for which LeRobot has a driver."""
_RANGES = re.compile(r"calibrated ranges ([\d. ]+) rad$")


@dataclass(frozen=True)
class Number:
    """A number of an actuator's state: its place in a row, its name and unit in LeRobot."""

    name: str  #: name in LeRobot: the actuator's name and ".pos", or the path of a field
    column: Column
    actuator: str
    field: str  #: path in the state; empty: the state is this number
    scale: float  #: LeRobot's unit per unit of the row
    lowest: float  #: limits at which LeRobot's drivers clip readings, in LeRobot's unit
    highest: float
    minimum: float  #: limits of the robot, in the unit of the row
    maximum: float

    def of_row(self, value: Any) -> Any:
        """Converts values of rows to LeRobot's unit, clipped as by LeRobot's drivers."""
        return np.clip(np.asarray(value, np.float64) * self.scale, self.lowest, self.highest)


def usual_units(schema: Mapping[str, Any]) -> Units:
    """Returns the units of LeRobot 0.4.4's driver of this arm, else "native"."""
    if tuple(each["name"] for each in schema["actuators"]) != JOINTS:
        return "native"
    return "normalised" if schema["robot"].startswith("koch") else "degrees"


def numbers_of(
    schema: Mapping[str, Any],
    part: Literal["observed", "desired"],
    units: Units | None = None,
    fields: Sequence[str] = (),
) -> list[Number]:
    """Returns the numbers of the actuators' states, in the order of the actuators.

    units: "degrees" for angles in radians; "normalised" for -100 to 100 over the calibrated range;
        in both, openings of 0 to 1 become 0 to 100; "native": as in rows (None: the units of
        LeRobot's driver of this arm, else "native").
    fields: only these, such as "elbow_flex" (empty: all).

    Raises InvalidArgument for an unknown field, and for "normalised" without a calibrated range.
    """
    units = units or usual_units(schema)
    if units not in get_args(Units):
        raise InvalidArgument(f"units must be one of {', '.join(get_args(Units))}, got {units!r}")
    columns = columns_of_part(schema, part)
    wanted = set(chosen(schema["robot"], [each.name for each in columns], fields))
    found = []
    rest = iter(columns)
    for actuator in actuators_of(dict(schema)):
        for number in actuator.numbers:
            column = next(rest)
            if fields and column.name not in wanted:
                continue
            low, high = number.limits.minimum, number.limits.maximum
            scale, lowest, highest = 1.0, -math.inf, math.inf
            if units != "native" and number.unit == "rad":
                scale = math.degrees(1)
                if units == "normalised":
                    scale, lowest, highest = 200 / _range(schema, actuator.index), -100, 100
            elif units != "native" and number.unit == "1" and (low, high) == (0, 1):
                scale, lowest, highest = 100.0, 0, 100
            name = f"{actuator.name}.{_short(number.name)}"
            place = Number(
                name, column, actuator.name, number.name, scale, lowest, highest, low, high
            )
            found.append(place)
    if most := [name for name, n in Counter(each.name for each in found).items() if n > 1]:
        raise InvalidArgument(f"'{schema['robot']}' has two numbers that LeRobot calls {most[0]}")
    return found


def sensor(column: Column) -> Number:
    """Makes the number of a sensor value, unscaled."""
    name = column.name.removeprefix("extended.")
    return Number(name, column, "", "", 1.0, -math.inf, math.inf, -math.inf, math.inf)


def _short(field: str) -> str:
    """Returns LeRobot's suffix for a number: "pos" for positions, "vel" for velocities."""
    return {"": "pos", "position": "pos", "velocity": "vel"}.get(field, field)


def _range(schema: Mapping[str, Any], index: int) -> float:
    """Reads an actuator's calibrated range [rad] from the help of its joints in the schema."""
    first = 0
    for group in schema["groups"]:
        said = _RANGES.search(group["type"]["fields"][0].get("help", ""))
        if said is not None and first <= index < first + len(said[1].split()):
            return float(said[1].split()[index - first])
        first += group["count"]
    raise InvalidArgument(
        f"'{schema['robot']}' has no calibrated ranges of its joints, so its angles cannot be "
        "normalised: use degrees. Only arms of o80-arms have these ranges; simulations and older "
        "recordings have none"
    )


def values_in(numbers: Sequence[Number], columns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Converts values (T, numbers) of rows to LeRobot's units."""
    each = [number.of_row(columns[:, i]) for i, number in enumerate(numbers)]
    return np.stack(each, axis=1) if each else np.empty((len(columns), 0))
