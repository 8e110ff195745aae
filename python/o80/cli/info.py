"""``o80 info``: describes a robot and its loop, or a recording."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

import o80._core as _core
from o80.base.screen import Column, print_json, print_table, style
from o80.cli.attach import attach
from o80.frontend.backend_texts import (
    clipped_text,
    halt_text,
    latency_percentiles,
    latency_text,
    pace_text,
    running_texts,
    starved_text,
    watchdog_text,
)
from o80.rows.actuators import ACTUATOR_HEADS, actuator_rows, field_text
from o80.rows.journal import latencies_of
from o80.rows.provenance import started_with


def info(
    segment: Annotated[
        str, typer.Argument(help="Name of a segment, see o80 list; or a recording (.mcap).")
    ],
    as_json: Annotated[bool, typer.Option("--json", help="All of it, for tools.")] = False,
) -> None:
    """Describe a robot: state of its loop, actuators, limits, sensor values, requests.

    Of a recording: its segments and runs, how many rows are missing, marks, options.
    """
    if segment.endswith(".mcap"):
        from o80.cli.recording_info import recording_info

        recording_info(Path(segment), as_json=as_json)
        return
    with attach(segment) as frontend:
        schema = frontend.schema
        if as_json:
            print_json({**schema, "provenance": asdict(frontend.provenance)})
            return
        loop = _core.loop_state(frontend)
        print(
            f"{style(segment, 'bold')}: robot {schema['robot']}, {loop.word}, "
            f"rows {frontend.oldest} to {frontend.published}, "
            f"{schema['row']['size']} bytes a row"
        )
        if frontend.alive:
            print(pace_text(loop))
        halt = halt_text(segment, frontend._halted, played=frontend.played)
        trouble = loop.trouble if frontend.alive else ""
        starved = starved_text(loop.starvations)
        running = running_texts(frontend._running_requests) if frontend.alive else []
        for said in (halt, trouble, starved, watchdog_text(schema), *running):
            if said:
                print(said)
        entries = frontend.journal()
        latency = latency_text(latency_percentiles(latencies_of(entries)), schema["period"])
        for line in (latency, clipped_text(entries)):
            if line:
                print(line)
        if schema["actuators"]:
            print()
            heads = [Column("", right=True), *(Column(name) for name in ACTUATOR_HEADS[1:])]
            print_table(heads, actuator_rows(schema))
        sections = {
            "sensor values": _fields(schema["extended"], "") if "extended" in schema else [],
            "enumerations": _enumerations(frontend.enums),
            "requests": map(_request, schema["requests"]),
            "started with": started_with(frontend.provenance),
        }
        for title, lines in sections.items():
            for number, line in enumerate(lines):
                if number == 0:
                    print(style(f"\n{title}", "bold"))
                print(f"  {line}")


def _request(described: dict[str, Any]) -> str:
    fields = ", ".join(_argument(field) for field in described["type"]["fields"])
    served = ", also while halted" if described["while_halted"] else ""
    told = style(f"{described['help']}{served}", "dim")
    return f"{described['name']}({fields})  {told}".rstrip()


def _argument(field: dict[str, Any]) -> str:
    """Formats a field of a request, with its default if it has one."""
    if "default" not in field:
        return str(field["name"])
    default = field["default"]
    for label, value in field.get("labels", {}).items():
        if value == default:
            default = label
    return f"{field['name']}={default}"


def _enumerations(enums: Mapping[str, Any]) -> list[str]:
    """Formats labels and numbers of each enumeration: "status: ok 0, moved 3"."""
    short = [name for name in enums if "." not in name or name.rpartition(".")[2] not in enums]
    return [
        f"{name}: "
        + ", ".join(f"{label} {number}" for label, number in enums[name]._labels_.items())
        for name in short
    ]


def _fields(described: dict[str, Any], prefix: str) -> list[str]:
    lines: list[str] = []
    for field in described["fields"]:
        text = f"{prefix}{field_text(field)}"
        lines.append(f"{text}  {style(field['help'], 'dim')}" if field["help"] else text)
        if field["kind"] == "struct":
            lines += _fields(field["type"], prefix + "  ")
    return lines
