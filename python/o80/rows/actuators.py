"""Actuators of a robot: their numbers and limits, and tables of them."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from o80.base import argument_checks
from o80.base.errors import InvalidArgument
from o80.rows.columns import numbers_below

ACTUATOR_HEADS = ("", "actuator", "state", "limits", "idle")


@dataclass(frozen=True)
class IntegralBounds:
    """Bounds of the integral of a number: a velocity moves the observed position of its actuator.

    o80 brakes the velocity in time, and lets it only move inward while the position is outside. The
    velocity rests at 0 and has no limit of jerk.
    """

    field: str  #: field of the observed state; of an array, the element of the same index
    minimum: float = -math.inf
    maximum: float = math.inf
    reaction: float = 0.0  #: delay of the observed velocity behind the desired one [s]

    def __post_init__(self) -> None:
        argument_checks.text(self.field, "field of o80.IntegralBounds")
        for name in ("minimum", "maximum", "reaction"):
            number = argument_checks.number(getattr(self, name), f"{name} of o80.IntegralBounds")
            object.__setattr__(self, name, number)

    def numbers(self) -> list[float]:
        """Minimum, maximum and reaction."""
        return [self.minimum, self.maximum, self.reaction]


NUMBERS = ("minimum", "maximum", "speed", "acceleration", "jerk", "error", "noise")


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits of one number, in the unit of its field; the default is no limit.

    A limit of acceleration needs one of speed; a limit of jerk needs one of acceleration.
    """

    minimum: float = -math.inf
    maximum: float = math.inf
    speed: float = math.inf  #: [unit/s]
    acceleration: float = math.inf  #: [unit/s^2]
    jerk: float = math.inf  #: [unit/s^3]
    error: float = math.inf  #: a larger difference of desired and observed halts the backend
    noise: float = 0.0  #: largest difference of two readings at rest; 0: a tenth of `error`
    integral: IntegralBounds | None = None  #: bounds of the position, if the number is a velocity

    def __post_init__(self) -> None:
        for name in NUMBERS:
            number = argument_checks.number(getattr(self, name), f"{name} of o80.Limits")
            object.__setattr__(self, name, number)
        if not isinstance(self.integral, IntegralBounds | None):
            raise InvalidArgument(
                f"integral of o80.Limits must be o80.IntegralBounds(...), got {self.integral!r}"
            )

    @classmethod
    def of(cls, given: "Limits | Sequence[float | None]") -> "Limits":
        """Makes limits from Limits, or from (minimum, maximum, ...) in the order of the fields."""
        if isinstance(given, Limits):
            return given
        if not isinstance(given, (tuple, list)) or len(given) > len(NUMBERS):
            raise InvalidArgument(
                f"limits must be o80.Limits({', '.join(n + '=' for n in NUMBERS)}), got {given!r}"
            )
        pairs = zip(NUMBERS, given, strict=False)
        return cls(**{name: value for name, value in pairs if value is not None})

    def numbers(self) -> tuple[float, ...]:
        """Returns all limits except the integral's, in the order of the fields."""
        return tuple(getattr(self, name) for name in NUMBERS)


@dataclass(frozen=True, kw_only=True)
class Number:
    """One number of an actuator's state."""

    name: str  #: path of fields, empty for a plain number
    unit: str
    help: str
    limits: Limits
    rest: float | None  #: value that it approaches without a command; None: it holds or follows


@dataclass(frozen=True, kw_only=True)
class Actuator:
    """One actuator."""

    index: int
    name: str
    group: str  #: empty if the robot is one array of actuators
    when_idle: str  #: "hold" or "follow"
    numbers: tuple[Number, ...]  #: numbers of its state, in order

    @property
    def paths(self) -> list[str]:
        """The paths of its numbers: "elbow", or "elbow.position" and more."""
        name = self.name or str(self.index)
        return [".".join(filter(None, (name, each.name))) for each in self.numbers]

    @property
    def limits(self) -> Limits:
        """The limits of the first number."""
        return self.numbers[0].limits


def _limits(described: dict[str, Any], paths: list[str]) -> Limits:
    """Makes the limits of one number. paths: names of all numbers of the state."""
    given = {key: described[key] for key in NUMBERS if described.get(key) is not None}
    if integral := described.get("integral"):
        known = {key: value for key, value in integral.items() if value is not None}
        given["integral"] = IntegralBounds(paths[known.pop("number")], **known)
    return Limits(**given)


def actuators_of(schema: dict[str, Any]) -> list[Actuator]:
    """The actuators of a schema."""
    actuators = []
    for index, row in enumerate(schema["actuators"]):
        group = schema["groups"][row["group"]]
        columns = [*numbers_below(group["type"])]
        paths = [column.name for column in columns]
        numbers = tuple(
            Number(
                name=column.name,
                unit=column.unit,
                help=column.help,
                limits=_limits(limit, paths),
                rest=limit.get("rest"),
            )
            for column, limit in zip(columns, row["limits"], strict=True)
        )
        actuators.append(
            Actuator(
                index=index,
                name=row["name"],
                group=group["name"],
                when_idle=row["when_idle"],
                numbers=numbers,
            )
        )
    return actuators


def blending(schema: dict[str, Any]) -> list[str]:
    """Names of the actuators whose states code of the driver interpolates (`blend`)."""
    types = [group["type"] for group in schema["groups"]]
    return [each["name"] for each in schema["actuators"] if "blends" in types[each["group"]]]


class Actuators(list[Actuator]):
    """The actuators of a robot; a notebook shows them like `o80 info`."""

    def __init__(self, actuators: Iterable[Actuator], schema: dict[str, Any]) -> None:
        super().__init__(actuators)
        self._schema = schema

    def _repr_html_(self) -> str:
        from o80.base.screen import html  # late: most processes show no table

        return html(ACTUATOR_HEADS, actuator_rows(self._schema))


def actuator_rows(schema: dict[str, Any]) -> list[list[str]]:
    """Makes a row with the columns ACTUATOR_HEADS for each actuator."""
    return [
        [
            str(index),
            actuator["name"],
            ", ".join(map(field_text, schema["groups"][actuator["group"]]["type"]["fields"])),
            "; ".join(map(_limit_text, actuator["limits"])),
            actuator["when_idle"],
        ]
        for index, actuator in enumerate(schema["actuators"])
    ]


def field_text(field: dict[str, Any]) -> str:
    """Formats name, shape and unit of a field."""
    unit = f" [{field['unit']}]" if field["unit"] else ""
    shape = f"({', '.join(str(n) for n in field['shape'])})" if field["shape"] else ""
    return f"{field['name'] or field['kind']}{shape}{unit}"


def _limit_text(limit: dict[str, Any]) -> str:
    low, high = limit["minimum"], limit["maximum"]
    parts = []
    if low is not None or high is not None:
        ends = "-inf" if low is None else f"{low:g}", "inf" if high is None else f"{high:g}"
        parts.append(" to ".join(ends))
    for name, unit in (("speed", "/s"), ("acceleration", "/s²"), ("jerk", "/s³")):
        if limit[name] is not None:
            parts.append(f"{limit[name]:g}{unit}")
    if limit["error"] is not None:
        parts.append(f"error {limit['error']:g}")
    if "noise" in limit:
        parts.append(f"noise {limit['noise']:g}")
    if "rest" in limit:
        parts.append(f"rests at {limit['rest']:g}")
    if moved := limit.get("integral"):
        low = -math.inf if moved["minimum"] is None else moved["minimum"]
        high = math.inf if moved["maximum"] is None else moved["maximum"]
        parts.append(f"its integral {low:g} to {high:g}, reaction {moved['reaction']:g} s")
    return ", ".join(parts) or "-"
