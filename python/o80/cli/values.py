"""Converts rows to plain lists, dictionaries and labels, and selects values by path."""

from itertools import compress
from typing import Any

import numpy as np

from o80._core import Observation
from o80.rows.columns import columns_at, labelled_value_of
from o80.rows.enumerations import Enumeration
from o80.rows.record import Record


class RowValues:
    """Converts the rows of one robot for printing."""

    def __init__(self, schema: dict[str, Any]) -> None:
        self._schema = schema
        self._actuators: list[str] = [actuator["name"] for actuator in schema["actuators"]]

    def plain(self, row: Observation) -> dict[str, Any]:
        """Converts a row to plain values for JSON; enumerations become labels."""
        return {
            "iteration": row.iteration,
            "time": row.time,
            "desired": _plain(row.desired),
            "observed": _plain(row.observed),
            "extended": _plain(row.extended) if "extended" in self._schema else None,
            "active": [bool(value) for value in row.active],
            "clamped": [bool(value) for value in row.clamped],
            "braking": [bool(value) for value in row.braking],
            "starved": [bool(value) for value in row.starved],
            "off_plan": [float(value) for value in row.off_plan],
            "halted": row.halted,
            "overruns": row.overruns,
            "missed_ticks": row.skipped,
            "starvations": row.starvations,
        }

    def acting(self, row: Observation) -> str:
        """Names the actuators that are driven, that brake, and whose plan is starved."""
        active, braking, starved = row.active, row.braking, row.starved
        said = []
        for word, acts in (
            ("driven", active & ~braking),
            ("braking", braking),
            ("starved", starved),
        ):
            if names := [*compress(self._actuators, acts)]:
                said.append(f"{word} {self._named(names)}")
        return "  ".join(said) or ("idle" if self._actuators else "")

    def _named(self, names: list[str]) -> str:
        if len(names) == len(self._actuators) > 2:
            return "all"
        rest = f" and {len(names) - 5} more" if len(names) > 5 else ""
        return ", ".join(names[:5]) + rest

    def choose(self, row: Observation, plain: dict[str, Any], path: str) -> Any:
        """Selects a value: "halted", "active.elbow", or a path of numbers, as in `row[path]`.

        plain: the row as plain values. Raises InvalidArgument for an unknown path.
        """
        if path in plain:
            return plain[path]
        part, _, actuator = path.partition(".")
        if actuator in self._actuators and isinstance(plain.get(part), list):
            return plain[part][self._actuators.index(actuator)]
        values = [labelled_value_of(row, column) for column in columns_at(self._schema, path)]
        return values[0] if len(values) == 1 else values


def _plain(value: Any) -> Any:
    """Converts to lists, dictionaries and labels; a number without a label stays."""
    if isinstance(value, Enumeration):
        return value._texts_.get(int(value), int(value))
    if isinstance(value, list):
        return [_plain(each) for each in value]
    names = value.keys() if isinstance(value, Record) else np.asarray(value).dtype.names
    if names is not None:
        return {name: _plain(value[name]) for name in names}
    return _plain(value.tolist()) if isinstance(value, (np.ndarray, np.generic)) else value


def text(value: Any) -> str:
    """Formats a plain value in one line."""
    if isinstance(value, dict):
        return " ".join(f"{name} {_inner(each)}" for name, each in value.items())
    return _inner(value)


def _inner(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + text(value) + "}"
    if isinstance(value, list):
        return "(" + " ".join(_inner(each) for each in value) + ")"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
