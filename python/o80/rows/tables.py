"""Tables for notebooks (HTML), and the texts that `o80 info` shares with them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from datetime import datetime
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from o80.frontend.segments import Segment
    from o80.recording.marks import Mark
    from o80.rows.actuators import Actuator
    from o80.rows.history import History
    from o80.rows.provenance import Provenance

ACTUATOR_HEADS = ("", "actuator", "state", "limits", "idle")
_ENDS = 5  # rows of each end of a history
_COLUMNS = 16  # most numbers of its rows


def html(heads: Sequence[str], rows: Iterable[Sequence[Any]], above: str = "") -> str:
    """An HTML table; all texts are escaped, because other users may have written them."""
    from html import escape  # late: every process that attaches loads this module

    lines = [f"<p>{escape(above)}</p>"] if above else []
    cells = "".join(f"<th>{escape(head)}</th>" for head in heads)
    lines.append(f"<table><thead><tr>{cells}</tr></thead><tbody>")
    for row in rows:
        cells = "".join(f"<td>{escape(str(cell))}</td>" for cell in row)
        lines.append(f"<tr>{cells}</tr>")
    return "\n".join([*lines, "</tbody></table>"])


class Segments(list["Segment"]):
    """Segments, in a notebook as `o80 list` shows them."""

    def _repr_html_(self) -> str:
        return html(
            ("segment", "state", "program", "pid", "user", ""),
            [
                (each.name, each.state, each.program, each.pid or "", each.user, each.problem)
                for each in self
            ],
        )


class Actuators(list["Actuator"]):
    """The actuators of a robot, in a notebook as `o80 info` shows them."""

    def __init__(self, actuators: Iterable[Actuator], schema: dict[str, Any]) -> None:
        super().__init__(actuators)
        self._schema = schema

    def _repr_html_(self) -> str:
        return html(ACTUATOR_HEADS, actuator_rows(self._schema))


class Marks(list["Mark"]):
    """The marks of a recording, in a notebook as a table."""

    def _repr_html_(self) -> str:
        return html(
            ("time", "mark", "rows", "values"),
            [
                (
                    datetime.fromtimestamp(each.time * 1e-9).isoformat(" ", "milliseconds"),
                    each.name,
                    ", ".join(f"{name} {row}" for name, row in each.rows.items()),
                    ", ".join(f"{name}={value}" for name, value in each.values.items()),
                )
                for each in self
            ],
        )


def provenance_html(provenance: Provenance) -> str:
    """How a backend was started, as `o80 info` says it."""
    from o80.rows.started_with import started_with

    lines = [line.partition(" ") for line in started_with(provenance)]
    return html(("started with", ""), [(what, text.strip()) for what, _, text in lines])


def history_html(history: History) -> str:
    """The first and the last rows of a history."""
    from o80.rows.columns import columns_of

    columns = [*columns_of(history.schema)]
    shown = columns[:_COLUMNS]
    more = f"; {len(columns) - len(shown)} more numbers a row" if len(columns) > _COLUMNS else ""
    count = len(history)
    places = [*range(count)]
    if count > 2 * _ENDS:
        places = [*range(_ENDS), *range(count - _ENDS, count)]
    rows: list[list[Any]] = []
    for place in places:
        row = history.rows[place : place + 1]
        rows.append([row["iteration"][0], row["time"][0]])
        for column in shown:
            value = row.getfield(column.dtype, column.offset)[0].item()
            words = [word for word, number in (column.labels or {}).items() if number == value]
            rows[-1].append(words[0] if words else f"{value:.6g}")
    if len(places) < count:
        rows.insert(_ENDS, ["…"] * (2 + len(shown)))
    heads = ["iteration", "time [ns]", *(column.name for column in shown)]
    return html(heads, rows, f"{count} observations{more}")


def actuator_rows(schema: dict[str, Any]) -> list[list[str]]:
    """A row of ACTUATOR_HEADS for each actuator."""
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
    """Name, shape and unit of a field."""
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
