"""Makes the schema of a segment from NumPy dtypes, for backends in Python."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np

import o80._core as _core
from o80.base import argument_checks
from o80.base.argument_checks import mapping
from o80.base.errors import InvalidArgument
from o80.rows.actuators import Limits

# a dtype, a number type, an IntEnum, or a mapping from field names to any of these
Described = Any
Limit = Limits | Sequence[float | None]


def numbered(name: str | int, known: Sequence[str], what: str) -> int:
    """Returns the number of an actuator or a request. Raises InvalidArgument if unknown."""
    if isinstance(name, str):
        if name in known:
            return known.index(name)
    elif hasattr(name, "__index__") and not isinstance(name, bool) and 0 <= name < len(known):
        return int(name)
    raise InvalidArgument(f"there is no {what} {name!r}{_core.names_instead(str(name), [*known])}")


class SchemaWriter:
    """Fills a schema from Python values."""

    def __init__(self, robot: str, units: Mapping[str, str]) -> None:
        self.builder = _core.SchemaBuilder(robot)
        self._units = units

    @classmethod
    def of(cls, robot: str, given: Callable[[str, Any], Any]) -> "SchemaWriter":
        """Makes the schema of a backend. given: returns arguments of `o80.Backend` by name."""

        def named(name: str, holds: str) -> Mapping[Any, Any]:
            return mapping(given(name, None), name, holds)

        writer = cls(robot, named("units", "fields to units"))
        writer.add_actuators(given("actuators", ()), given("dtype", float))
        if (extended := given("extended", None)) is not None:
            writer.set_extended(extended)
        requests = named("requests", "names to dtypes or None")
        writer.add_requests(requests, given("while_halted", ()))
        writer.set_limits(named("limits", "actuators to limits"))
        writer.set_rests(named("rests_at", "actuators to fields and values"))
        writer.set_idle(given("when_idle", "hold"))
        writer.set_model(given("model", None), named("joints", "joints to what moves them"))
        return writer

    def add_actuators(self, actuators: Any, dtype: Described) -> None:
        """Adds actuators by names, by number, or by a mapping from groups to their members."""
        if isinstance(actuators, Mapping):
            for group, members in actuators.items():
                self._add_group(group, members)
        elif isinstance(actuators, int):
            if actuators < 0:
                raise InvalidArgument(
                    f"the number of actuators must be at least 0, got {actuators}"
                )
            if actuators > 0:
                self.builder.add_actuators("", self._type("State", dtype), actuators, True)
        elif isinstance(actuators, Sequence) and not isinstance(actuators, str):
            if actuators:
                self._add_named("", actuators, dtype)
        else:
            raise InvalidArgument(
                f"actuators must be a list of names, a number, or a mapping from groups to dtypes, "
                f"got {actuators!r}"
            )

    def _add_group(self, group: str, members: Any) -> None:
        """Adds a group. members: a type (one actuator), (type, number), or (type, names)."""
        if not (isinstance(members, tuple) and len(members) == 2):
            self.builder.add_actuators(group, self._type(group, members), 1, False)
            return
        described, many = members
        if isinstance(many, int):
            self.builder.add_actuators(group, self._type(group, described), many, True)
        else:
            self._add_named(group, many, described)

    def _add_named(self, group: str, names: Sequence[str], described: Described) -> None:
        first = len(self.builder.actuators)
        self.builder.add_actuators(group, self._type(group or "State", described), len(names), True)
        for i, name in enumerate(names):
            self.builder.name_actuator(first + i, name)

    def set_extended(self, extended: Described) -> None:
        """Sets the type of further sensor values: a structured dtype, or a mapping."""
        self.builder.set_extended(self._type("Extended", extended))

    def add_requests(
        self, requests: Mapping[str, Described | None], while_halted: Sequence[str] = ()
    ) -> None:
        """Adds requests, each with its fields (None: no fields).

        while_halted: names of requests that are also served while the robot is halted.
        """
        for name in while_halted:
            if name not in requests:
                instead = _core.names_instead(name, list(requests))
                raise InvalidArgument(f"while_halted: there is no request '{name}'{instead}")
        for name, fields in requests.items():
            described = self._type(name, {} if fields is None else fields)
            self.builder.add_request(name, described, "", name in while_halted)

    def set_limits(self, limits: Mapping[Any, Limit | Mapping[str, Limit]]) -> None:
        """Sets limits of actuators: of their first number, or a mapping from fields to limits."""
        for named, given in limits.items():
            actuator = self._index(named)
            for field, limit in given.items() if isinstance(given, Mapping) else [("", given)]:
                given_limits = Limits.of(limit)
                integral = given_limits.integral
                self.builder.set_limits(
                    actuator,
                    field,
                    list(given_limits.numbers()),
                    integral.field if integral else "",
                    integral.numbers() if integral else [0.0] * 3,
                )

    def set_rests(self, rests: Mapping[Any, Mapping[str, float]]) -> None:
        """Sets the values that fields of actuators approach without a command."""
        for named, fields in rests.items():
            for field, value in fields.items():
                rest = argument_checks.number(value, f"rests_at of {field!r} of actuator {named!r}")
                self.builder.rests_at(self._index(named), field, rest)

    def set_idle(self, when_idle: str | Mapping[Any, str]) -> None:
        """Sets "hold" or "follow" for all actuators, or for each."""
        words = (
            when_idle
            if isinstance(when_idle, Mapping)
            else dict.fromkeys(self.builder.actuators, when_idle)
        )
        for named, word in words.items():
            if word not in ("hold", "follow"):
                raise InvalidArgument(f"when_idle must be 'hold' or 'follow', got {word!r}")
            if word == "follow":
                self.builder.set_follow(self._index(named))

    def set_model(
        self,
        model: str | os.PathLike[str] | None,
        joints: Mapping[str, int | str | tuple[str, int]],
    ) -> None:
        """Sets the model for viewers, and the source of each joint's position."""
        if model is None:
            if joints:
                raise InvalidArgument("joints were given without a model: give model too")
            return
        if isinstance(model, str) and model.lstrip().startswith("<"):
            self.builder.set_model(model, "")
        else:
            self.builder.set_model(_text_of(Path(model)), str(Path(model).absolute()))
        for joint, moved_by in joints.items():
            if isinstance(moved_by, tuple):
                field, index = moved_by
                self.builder.sensor_moves_joint(field, index, joint)
            else:
                self.builder.moves_joint(self._index(moved_by), joint)

    def _index(self, named: int | str) -> int:
        return numbered(named, self.builder.actuators, "actuator")

    # ------------------------------------------------------------------ types

    def _type(self, name: str, described: Described) -> int:
        return self.builder.add_type(name, list(self._fields(name, described)))

    def _fields(self, owner: str, described: Described) -> Iterator[dict[str, Any]]:
        if isinstance(described, Mapping):
            for name, inner in described.items():
                yield self._field(owner, name, inner)
            return
        dtype = None if _is_enum(described) else np.dtype(described)
        if dtype is None or dtype.names is None:
            yield self._field(owner, "", described)
            return
        assert dtype.fields is not None
        for name in dtype.names:
            yield self._field(owner, name, dtype.fields[name][0])

    def _field(self, owner: str, name: str, described: Described) -> dict[str, Any]:
        unit = self._units.get(f"{owner}.{name}", self._units.get(name, ""))
        field = {"name": name, "unit": unit, "shape": []}
        if _is_enum(described):
            labels = {label: int(value) for label, value in described.__members__.items()}
            return {**field, "kind": "enum", "size": 8, "signed": True, "labels": labels}
        if isinstance(described, Mapping):
            return {**field, "kind": "struct", "index": self._type(name, described)}
        dtype = np.dtype(described)
        element, shape = dtype.subdtype or (dtype, ())
        field["shape"] = list(shape)
        if element.names is not None:
            return {**field, "kind": "struct", "index": self._type(name, element)}
        if element.kind not in "biuf" or element.itemsize > 8 or element == np.dtype(np.float16):
            raise InvalidArgument(
                f"'{name or owner}' must be a number of 1 to 8 bytes, a boolean or an enum, "
                f"got dtype {element}"
            )
        return {**field, "kind": element.name}


def _text_of(model: Path) -> str:
    """Reads the text of an MJCF file. Raises InvalidArgument if it is unreadable."""
    try:
        return model.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidArgument(
            f"model must be the path of an MJCF file, or its text, which begins with '<': {error}"
        ) from error


def _is_enum(described: Described) -> bool:
    return isinstance(described, type) and issubclass(described, IntEnum)
