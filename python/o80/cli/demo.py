"""``o80 demo``: the first minute with a robot."""

import os
import sys
import textwrap
from typing import TYPE_CHECKING, Annotated, Any

import typer

from o80.base.errors import InvalidArgument
from o80.base.installation import announced
from o80.base.screen import style

if TYPE_CHECKING:
    from numpy.typing import NDArray

GROUP = "o80.demos"
"""Entry points of packages that bring a demo: programs, which read sys.argv."""
WIDTH, HEIGHT = 60, 9  # of a plot, in characters
DESIRED, OBSERVED = ".", "#"
PROGRAM = """\
import o80

robot = o80.robots.load("two_joints")
with robot.start("{segment}", gain=5.0) as run, run.frontend() as arm:
    arm.add_command("shoulder", 1.0, duration=0.8)  # [rad], [s]
    arm.add_command("shoulder", 0.2, speed=1.0)  # queued behind the first
    arm.add_command("elbow", -0.6, duration=1.6, profile="minimum_jerk")
    arm.pulse_and_wait(timeout=30.0)
    rows = arm.history()  # every iteration
"""
NEXT = {
    "o80 run two_joints": "the robot, until Ctrl-C; in another terminal:",
    "o80 list": "which robots run, and at which rate",
    "o80 echo two_joints": "what the robot is doing",
    "o80 view two_joints": "the robot in the browser, also back in time",
    "o80 --help": "all commands; docs/README.md lists all pages",
}


def demo(
    context: typer.Context,
    name: Annotated[
        str | None, typer.Argument(help="A demo of an installed package, such as table_tennis.")
    ] = None,
) -> None:
    """Run a simulated robot, move two joints, plot what they did, and show what to type next."""
    if name is not None:
        _run_demo_of_package(name, context.args)
        return
    print("This program starts a simulated robot as a process of its own, and moves it:\n")
    program = PROGRAM.format(segment=f"demo-{os.getpid()}")  # several users may run it at once
    print(textwrap.indent(program, "    "))
    names: dict[str, Any] = {}
    exec(compile(program, "<o80 demo>", "exec"), names)
    rows = names["rows"]
    seconds = (rows.time - rows.time[0]) * 1e-9
    print(f"{len(rows)} iterations in {seconds[-1]:.1f} s, {rows.overruns[-1]} of them late.")
    print(f"{DESIRED} desired position [rad], {OBSERVED} observed: the joints follow with a lag\n")
    for joint in ("shoulder", "elbow"):
        curves = (rows[f"desired.{joint}"], rows[f"observed.{joint}"])
        print("\n".join(chart(joint, seconds, *curves)))
    print(style("\nType next", "bold"))
    for command, what in (NEXT | _demos_of_packages()).items():
        print(f"  {command:<28}  {what}")


def _demos_of_packages() -> dict[str, str]:
    found = {
        f"o80 demo {name}": f"the demo of {point.dist.name}"
        for name, point in announced(GROUP).items()
        if point.dist
    }
    return found or {
        "pip install o80-table-tennis": "then `o80 demo table_tennis`: a whole experiment"
    }


def _run_demo_of_package(name: str, flags: list[str]) -> None:
    found = announced(GROUP)
    if name not in found:
        names = ", ".join(found) or "none; pip install o80-table-tennis brings table_tennis"
        raise InvalidArgument(f"unknown demo '{name}', installed demos: {names}")
    sys.argv = [f"o80 demo {name}", *flags]
    found[name].load()()


def chart(
    name: str, seconds: "NDArray[Any]", desired: "NDArray[Any]", observed: "NDArray[Any]"
) -> list[str]:
    """Draws two curves with plain characters; returns lines of at most 80."""
    import numpy as np

    at = np.linspace(0, len(seconds) - 1, WIDTH).round().astype(int)
    low, high = np.min([desired, observed]), np.max([desired, observed])
    canvas = np.full((HEIGHT, WIDTH), " ")
    for curve, mark in ((desired, DESIRED), (observed, OBSERVED)):
        from_top = (high - curve[at]) / max(high - low, 1e-9) * (HEIGHT - 1)
        canvas[from_top.round().astype(int), np.arange(WIDTH)] = mark
    labels = [""] * HEIGHT
    labels[0], labels[HEIGHT // 2], labels[-1] = f"{high:.2f}", name, f"{low:.2f}"
    drawn = [
        f"{label:>9} |{''.join(row)}".rstrip() for label, row in zip(labels, canvas, strict=True)
    ]
    end = f"{seconds[-1]:.1f} s"
    return [*drawn, f"{'':>9} +{'-' * WIDTH}", f"{'':>9}  0{end:>{WIDTH - 1}}"]
