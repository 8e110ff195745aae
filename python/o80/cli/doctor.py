"""``o80 doctor``: whether this computer can serve a robot at a rate."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated

import typer

from o80.base.screen import plain, print_json, style
from o80.base.symptoms import see

if TYPE_CHECKING:
    from o80.robots.doctor.check import Finding
    from o80.robots.doctor.doctor import Measure, Report
    from o80.robots.doctor.wake_ups import WakeUps


def doctor(
    frequency: Annotated[
        float, typer.Option(help="Iterations a second of the robot.", min=0.1, max=1e5)
    ] = 1000.0,
    seconds: Annotated[
        float,
        typer.Option(
            help="Seconds to measure a loop, and again beside a load; 0: only look.",
            min=0.0,
            max=3600.0,
        ),
    ] = 2.0,
    as_json: Annotated[bool, typer.Option("--json", help="For tools.")] = False,
) -> None:
    """Say whether this computer can serve a robot at a rate, and if not, why.

    Each finding names the problem, the command that solves it and the command that undoes this.
    Nothing is changed. The exit status is 0 if no problem was found, else 1.
    """
    from o80.robots.doctor.computer import Computer
    from o80.robots.doctor.doctor import examine
    from o80.robots.doctor.wake_ups import measure, measure_beside_load

    if math.isnan(frequency) or math.isnan(seconds):
        raise typer.BadParameter("--frequency and --seconds must be numbers, got nan")

    def measured_by(call: "Callable[[float, float, list[int]], WakeUps]") -> "Measure":
        return lambda computer: call(frequency, seconds, computer.isolated) if seconds else None

    report = examine(Computer(), frequency, measured_by(measure), measured_by(measure_beside_load))
    if as_json:
        print_json(report.as_dict())
    else:
        _print(report)
    if not report.serves:
        raise typer.Exit(1)


def _print(report: "Report") -> None:
    print(style(report.verdict, "green" if report.serves else "bold"))
    for number, finding in enumerate(report.culprits, 1):
        print(f"\n{number}. {_text(finding)}")
    remarks = [finding for finding in report.findings if finding.remark]
    if remarks:
        print("\nWorth knowing:")
    for finding in remarks:
        print(f"\n- {_text(finding)}")
    print()
    for head, measured in (("alone", report.measured), ("beside a load", report.loaded)):
        if measured is not None:
            print(f"{head}: " + "\n".join(map(plain, str(measured).splitlines())))
    for path, reason in report.unread.items():
        print(f"could not be read: {plain(path)} ({plain(reason)})")
    about = report.computer
    parts = [about["system"]]
    parts += [f"kernel {about['kernel']}"] if about["kernel"] else []
    parts += [f"{len(about['processors'])} processors"]
    parts += [f"container ({about['container']})"] if about["container"] else []
    print(plain(", ".join(part for part in parts if part)))
    if not report.serves:
        print(see("late_loop"))


def _text(finding: "Finding") -> str:
    lines = [f"{style(finding.name, 'bold')}: {plain(finding.seen)}", f"   {plain(finding.effect)}"]
    for head, commands in (("cure:", finding.cure), ("undo:", finding.undo)):
        for line in commands.splitlines():
            lines.append(f"   {head} {plain(line)}")
            head = "     "
    return "\n".join(lines)
