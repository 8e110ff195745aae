"""The face of a robot: groups, states, units, limits, sensor values and requests, as plain data."""

import contextlib
import itertools
import json
import math
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from o80.base.errors import InvalidArgument, TimeoutError, exception_text
from o80.frontend.frontend import Frontend
from o80.frontend.segments import segments
from o80.rows.layout import dtype_of_type

OF_SIMULATIONS = ("reset", "snapshot", "restore")
"""Requests that every simulation adds to its own."""
_LIMITS = {
    "minimum": -math.inf,
    **dict.fromkeys(("maximum", "speed", "acceleration", "jerk", "error"), math.inf),
    "rest": 0.0,
}
_INTEGERS = [f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)]
_KINDS = ["bool", *_INTEGERS, "float32", "float64", "enum", "struct"]
_ORIGINS = ("robot", "clock", "world", "absent")
_NO_TYPE = 2**32 - 1
_MOST_OF_A_REASON = 200  # characters
_BEGIN = "face\t1\t"


def described(of: Any, load: Callable[[Any], Any]) -> Mapping[str, Any]:
    """The schema of a robot, a segment, a recording, a file, or of what these names stand for.

    load: loads a robot. Raises InvalidArgument, DriverError, RecordingError.
    """
    if isinstance(of, (str, os.PathLike)):
        of = _named(os.fspath(of), load)
    elif isinstance(of, type):  # a driver
        of = load(of)
    if hasattr(of, "segments"):  # a recording
        of = _only(of)
    if not isinstance(of, Mapping):
        of = of.describe() if hasattr(of, "describe") else getattr(of, "schema", None)
    if not isinstance(of, Mapping):
        raise InvalidArgument(
            "a face is taken from a robot, a segment, a recording or a file, or their names"
        )
    return of


def _named(name: str, load: Callable[[Any], Any]) -> Any:
    if name.endswith(".json"):
        try:
            return json.loads(Path(name).read_text())
        except (OSError, ValueError, RecursionError) as error:
            raise InvalidArgument(f"{name} holds no description of a robot: {error}") from None
    file, _, segment = name.rpartition(":") if ".mcap:" in name else (name, "", "")
    if file.endswith(".mcap") or (os.sep in file and Path(file).is_dir()):
        from o80.recording.reader import open as opened

        recording = opened(file)
        if segment and segment not in recording:
            raise InvalidArgument(
                f"{file} has no segment '{segment}', it has: {', '.join(recording) or 'none'}"
            )
        return recording[segment] if segment else recording
    if any(each.name == name and each.alive for each in segments()):
        with contextlib.suppress(TimeoutError), Frontend(name, 0.0, read_only=True) as frontend:
            return frontend.schema
    return load(name)


def _only(recording: Any) -> Any:
    names = [*recording]
    if len(names) != 1:
        raise InvalidArgument(
            f"the recording has {len(names)} segments, not one: say which, as FILE.mcap:NAME"
        )
    return recording[names[0]]


def compared(schema: Mapping[str, Any]) -> dict[str, Any]:
    """The part of a schema that programs see: without helps, offsets, and OF_SIMULATIONS."""

    def part(value: Any) -> Any:
        if isinstance(value, Mapping):
            unseen = ("help", "offset", "origin")
            return {key: part(each) for key, each in value.items() if key not in unseen}
        return [part(each) for each in value] if isinstance(value, list) else value

    requests = [each for each in schema["requests"] if each["name"] not in OF_SIMULATIONS]
    return {
        "groups": part(schema["groups"]),
        "actuators": part(schema["actuators"]),
        **({"extended": part(schema["extended"])} if "extended" in schema else {}),
        "requests": part(sorted(requests, key=lambda request: request["name"])),
    }


def text_of_face(schema: Mapping[str, Any]) -> str:
    """The text that include/o80/describe/face.hpp reads."""
    try:
        return "\n".join(_Writer(schema).lines())
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        why = exception_text(error)[:_MOST_OF_A_REASON]
        raise InvalidArgument(f"the description is not complete: {why}") from None
    except RecursionError:
        raise InvalidArgument("the description is nested too deeply") from None


def is_text_of_face(text: object) -> bool:
    """True for what `text_of_face` gives."""
    return isinstance(text, str) and text.startswith(_BEGIN)


class _Writer:
    """Writes tables line by line. Offsets that are not given are those of a C++ struct."""

    def __init__(self, schema: Mapping[str, Any]) -> None:
        self._schema = schema
        self._lines: list[str] = []
        self._types = itertools.count()

    def lines(self) -> list[str]:
        schema, block = self._schema, 0
        for group in schema["groups"]:
            index, size, alignment = self._type(group["type"])
            offset = group.get("offset", _up(block, alignment))
            block = offset + group["count"] * size
            self._add("group", group["name"], index, offset, group["count"], int(group["array"]))
        numbers = itertools.count()
        for i, actuator in enumerate(schema["actuators"]):
            self._add("actuator", i, actuator["name"], int(actuator["when_idle"] == "follow"))
            for limit in actuator["limits"]:
                self._limit(next(numbers), limit)
        if "extended" in schema:
            self._add("extended", self._type(schema["extended"])[0])
        for request in schema["requests"]:
            index, *_ = self._type(request["type"])
            halted, told = int(request["while_halted"]), request.get("help", "")
            self._add("request", request["name"], index, halted, told)
        head = schema.get("robot", ""), str(schema.get("period", 0)), str(_up(block, 8))
        return [_BEGIN + "\t".join(head), *self._lines]

    def _add(self, *fields: Any) -> None:
        self._lines.append("\t".join(map(str, fields)))

    def _limit(self, index: int, limit: Mapping[str, Any]) -> None:
        given = {key: value for key, value in limit.items() if value is not None}
        numbers = [float(given.get(name, none)) for name, none in _LIMITS.items()]
        self._add("limit", index, *numbers, int("rest" in given), float(given.get("noise", 0)))
        if integral := given.get("integral"):
            low, high = integral["minimum"], integral["maximum"]
            bounds = -math.inf if low is None else low, math.inf if high is None else high
            self._add("integral", index, integral["number"], *bounds, integral["reaction"])

    def _type(self, described: Mapping[str, Any]) -> tuple[int, int, int]:
        """Adds a type, after those in it: its index, size and alignment."""
        if described.get("blends"):
            raise InvalidArgument(
                f"the state '{described['name']}' has an interpolation that only its robot knows"
            )
        fields, lines = [], []
        end, alignment = 0, 1
        for field in described["fields"]:
            kind, inner = field["kind"], _NO_TYPE
            if kind == "struct":
                inner, size, aligned = self._type(field["type"])
            else:
                size = aligned = field["size"] if kind == "enum" else np.dtype(kind).itemsize
            offset = field.get("offset", _up(end, aligned))
            end, alignment = offset + math.prod(field["shape"]) * size, max(alignment, aligned)
            fields.append({**field, "offset": offset})
            place = (_KINDS.index(kind), offset, size, *(*field["shape"], 0, 0)[:2], inner)
            marks = (int(field.get("signed", False)), int("default" in field))
            origin = _ORIGINS.index(field.get("origin", "robot"))
            rest = (int("rest" in field), float(field.get("rest", 0)))
            texts = (field.get("unit", ""), field.get("help", ""))
            lines.append(("field", field["name"], *place, *marks, origin, *rest, *texts))
            lines += [("label", *label) for label in field.get("labels", {}).items()]
        lines.append(("type", described["name"], described["size"], alignment, len(fields)))
        lines += [("default", byte) for byte in _defaults({**described, "fields": fields})]
        for line in lines:
            self._add(*line)
        return next(self._types), described["size"], alignment


def _up(value: int, step: int) -> int:
    return -(-value // step) * step


def _defaults(described: dict[str, Any]) -> bytes:
    """The bytes of the default values of a request; empty without any."""
    given = {field["name"]: field["default"] for field in described["fields"] if "default" in field}
    if not given:
        return b""
    values = np.zeros((), dtype_of_type(described))
    for name, value in given.items():
        if value is not None:
            values[name] = tuple(value.values()) if isinstance(value, Mapping) else value
    return values.tobytes()
