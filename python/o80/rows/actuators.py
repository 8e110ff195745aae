"""The actuators of a robot and their numbers, as its segment describes them."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from dataclasses import fields as fields_of
from typing import Any

from o80.rows.limits import IntegralBounds, Limits

LIMITS = tuple(field.name for field in fields_of(Limits) if field.name != "integral")


@dataclass(frozen=True, kw_only=True)
class Number:
    """One number of an actuator's state."""

    name: str  #: path of fields, empty for a plain number
    unit: str
    help: str
    limits: Limits
    rest: float | None  #: value to which it goes without a command; None: it holds or follows

    @property
    def minimum(self) -> float:
        """The least value; -inf: not limited."""
        return self.limits.minimum

    @property
    def maximum(self) -> float:
        """The largest value; inf: not limited."""
        return self.limits.maximum

    @property
    def speed(self) -> float:
        """The largest speed [unit/s]; inf: not limited."""
        return self.limits.speed


@dataclass(frozen=True, kw_only=True)
class Actuator:
    """One actuator."""

    index: int
    name: str
    group: str  #: empty if the robot is one array of actuators
    when_idle: str  #: "hold" or "follow"
    numbers: tuple[Number, ...]  #: of its state, in order

    @property
    def limits(self) -> Limits:
        """The limits of the first number."""
        return self.numbers[0].limits

    @property
    def unit(self) -> str:
        """The unit of the first number."""
        return self.numbers[0].unit

    @property
    def minimum(self) -> float:
        """The least value of the first number."""
        return self.numbers[0].minimum

    @property
    def maximum(self) -> float:
        """The largest value of the first number."""
        return self.numbers[0].maximum

    @property
    def speed(self) -> float:
        """The largest speed of the first number [its unit/s]."""
        return self.numbers[0].speed


def names_of(described: dict[str, Any], path: str = "") -> Iterator[tuple[str, str, str]]:
    """Path, unit and help of every number of a described type, in order."""
    for field in described["fields"]:
        inner = f"{path}.{field['name']}" if path and field["name"] else path or field["name"]
        for place in itertools.product(*map(range, field["shape"])):
            here = inner + "".join(f"[{i}]" for i in place)
            if field["kind"] == "struct":
                yield from names_of(field["type"], here)
            else:
                yield here, field["unit"], field["help"]


def _limits(described: dict[str, Any], paths: list[str]) -> Limits:
    """The limits of one number. paths: names of all numbers of the state."""
    given = {key: described[key] for key in LIMITS if described.get(key) is not None}
    if integral := described.get("integral"):
        known = {key: value for key, value in integral.items() if value is not None}
        given["integral"] = IntegralBounds(paths[known.pop("number")], **known)
    return Limits(**given)


def actuators_of(schema: dict[str, Any]) -> list[Actuator]:
    """The actuators of a schema."""
    actuators = []
    for index, row in enumerate(schema["actuators"]):
        group = schema["groups"][row["group"]]
        names = [*names_of(group["type"])]
        paths = [name for name, _, _ in names]
        numbers = tuple(
            Number(
                name=name,
                unit=unit,
                help=text,
                limits=_limits(limit, paths),
                rest=limit.get("rest"),
            )
            for (name, unit, text), limit in zip(names, row["limits"], strict=True)
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
