"""``o80 info``: what a robot is made of."""

from __future__ import annotations

from typing import Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

import o80
from o80.cli.condition import halt_text, loop_text, running_texts, watchdog_text
from o80.cli.screen import out, print_json


def info(
    segment: Annotated[str, typer.Argument(help="Name of a segment; see o80 list.")],
    as_json: Annotated[bool, typer.Option("--json", help="The whole schema, for tools.")] = False,
    timeout: Annotated[float, typer.Option(help="Seconds to wait for the backend.")] = 1.0,
) -> None:
    """Describe a robot: actuators, limits, sensor values, requests."""
    with o80.Frontend(segment, timeout=timeout, read_only=True, dead=True) as frontend:
        schema = frontend.schema
        if as_json:
            print_json(schema)
            return
        pace = "bursting" if frontend.bursting else f"{frontend.frequency:g} Hz"
        out.print(
            f"[bold]{segment}[/bold]: robot {schema['robot']}, {pace}, "
            f"rows {frontend.oldest} to {frontend.published}, "
            f"{schema['row']['size']} bytes a row"
        )
        conditions = halt_text(frontend), loop_text(frontend), watchdog_text(schema)
        for said in (*conditions, *running_texts(frontend)):
            if said:
                out.print(escape(said), soft_wrap=True)
        if schema["actuators"]:
            out.print(_actuators(schema))
        if "extended" in schema:
            out.print("\n[bold]sensor values[/bold]")
            for line in _fields(schema["extended"], ""):
                out.print(f"  {line}", soft_wrap=True)
        if schema["requests"]:
            out.print("\n[bold]requests[/bold]")
            for request in schema["requests"]:
                fields = ", ".join(_argument(field) for field in request["type"]["fields"])
                served = ", also while halted" if request["while_halted"] else ""
                out.print(f"  {request['name']}({fields})  [dim]{request['help']}{served}[/dim]")


def _actuators(schema: dict[str, Any]) -> Table:
    table = Table(box=None, pad_edge=False, header_style="bold")
    for name in ("", "actuator", "state", "limits", "idle"):
        table.add_column(name)
    for index, actuator in enumerate(schema["actuators"]):
        fields = schema["groups"][actuator["group"]]["type"]["fields"]
        table.add_row(
            str(index),
            actuator["name"],
            ", ".join(_field(field) for field in fields),
            "; ".join(_limit(limit) for limit in actuator["limits"]),
            actuator["when_idle"],
        )
    return table


def _field(field: dict[str, Any]) -> str:
    unit = f" \\[{field['unit']}]" if field["unit"] else ""
    shape = f"({', '.join(str(n) for n in field['shape'])})" if field["shape"] else ""
    return f"{field['name'] or field['kind']}{shape}{unit}"


def _argument(field: dict[str, Any]) -> str:
    """A field of a request; one without a default must be given."""
    if "default" not in field:
        return str(field["name"])
    default = field["default"]
    for label, value in field.get("labels", {}).items():
        if value == default:
            default = label
    return f"{field['name']}={default}"


def _limit(limit: dict[str, Any]) -> str:
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
    if "rest" in limit:
        parts.append(f"rests at {limit['rest']:g}")
    return ", ".join(parts) or "-"


def _fields(described: dict[str, Any], prefix: str) -> list[str]:
    lines: list[str] = []
    for field in described["fields"]:
        text = f"{prefix}{_field(field)}"
        lines.append(f"{text}  [dim]{field['help']}[/dim]" if field["help"] else text)
        if field["kind"] == "struct":
            lines += _fields(field["type"], prefix + "  ")
    return lines
