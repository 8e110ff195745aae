"""The face of a robot: groups, states, units, limits, sensor values and requests, as plain data."""

import base64
import contextlib
import itertools
import json
import math
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import o80._core as _core
from o80.base.errors import InvalidArgument, TimeoutError, exception_text
from o80.frontend.frontend import Frontend
from o80.frontend.segments import segments

OF_SIMULATIONS = ("reset", "snapshot", "restore")  #: requests that every simulation adds to its own
_LIMITS = {
    "minimum": -math.inf,
    **dict.fromkeys(("maximum", "speed", "acceleration", "jerk", "error"), math.inf),
    "rest": 0.0,
}
_MOST_OF_A_REASON = 200  # characters
_BEGIN = "face:"


def described(of: Any, load: Callable[[Any], Any]) -> Mapping[str, Any]:
    """Returns the schema of a robot, a segment, a recording or a file, or of one given by name.

    load: loads a robot. Raises InvalidArgument, DriverError, RecordingError if `of` has no schema.
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
            f"the recording has {len(names)} segments, not one: name one, as FILE.mcap:NAME"
        )
    return recording[names[0]]


def compared(schema: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the part of a schema that affects programs: no helps, offsets, OF_SIMULATIONS."""

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
    """Encodes a description as a text that include/o80/describe/face.hpp reads."""
    try:
        builder, period = _built(schema), int(schema.get("period", 0))
    except InvalidArgument:
        raise
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        why = exception_text(error)[:_MOST_OF_A_REASON]
        raise InvalidArgument(f"the description is not complete: {why}") from None
    except RecursionError:
        raise InvalidArgument("the description is nested too deeply") from None
    return _BEGIN + base64.b64encode(builder.face(period)).decode()


def is_text_of_face(text: object) -> bool:
    """True for a text made by `text_of_face`."""
    return isinstance(text, str) and text.startswith(_BEGIN)


def _built(schema: Mapping[str, Any]) -> _core.SchemaBuilder:
    """Builds the tables of a description, as segments hold them."""
    builder = _core.SchemaBuilder(schema.get("robot", ""))
    for group in schema["groups"]:
        index = _add_type(builder, group["type"])
        if "offset" in group:
            builder.set_block(group["offset"])
        builder.add_actuators(group["name"], index, group["count"], bool(group["array"]))
    numbers = itertools.count()
    for i, actuator in enumerate(schema["actuators"]):
        builder.name_actuator(i, actuator["name"])
        if actuator["when_idle"] == "follow":
            builder.set_follow(i)
        for limit in actuator["limits"]:
            _set_limit(builder, next(numbers), limit)
    if "extended" in schema:
        builder.set_extended(_add_type(builder, schema["extended"]))
    for request in schema["requests"]:
        index = _add_type(builder, request["type"])
        help_text, halted = request.get("help", ""), bool(request["while_halted"])
        builder.add_request(request["name"], index, help_text, halted)
    return builder


def _set_limit(builder: _core.SchemaBuilder, index: int, limit: Mapping[str, Any]) -> None:
    given = {key: value for key, value in limit.items() if value is not None}
    numbers = [float(given.get(name, none)) for name, none in _LIMITS.items()]
    builder.set_limit_row(index, numbers, "rest" in given, given.get("noise", 0))
    if integral := given.get("integral"):
        low, high = integral["minimum"], integral["maximum"]
        bounds = -math.inf if low is None else low, math.inf if high is None else high
        builder.add_integral(index, integral["number"], [*bounds, integral["reaction"]])


def _add_type(builder: _core.SchemaBuilder, described: Mapping[str, Any]) -> int:
    """Adds a type, after its inner types; returns its index."""
    fields = [
        {**field, "index": _add_type(builder, field["type"])} if "type" in field else {**field}
        for field in described["fields"]
    ]
    size, blends = described["size"], described.get("blends", False)
    return builder.add_type(described["name"], fields, size, blends)
