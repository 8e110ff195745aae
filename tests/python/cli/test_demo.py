"""`o80 demo`: what a newcomer sees first."""

import os
import re
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
from processes import run_o80

from o80.cli.app import COMMANDS
from o80.cli.demo import NEXT, PROGRAM, chart


def test_two_joints_are_moved_and_plotted_on_a_terminal_of_80_columns(tmp_path: Path) -> None:
    with ThreadPoolExecutor(2) as two_users:  # at once
        run = partial(run_o80, "demo", env=os.environ | {"O80_DIRECTORY": str(tmp_path)})
        said, _ = [each.result().stdout for each in [two_users.submit(run) for _ in range(2)]]

    assert all(len(line) <= 80 for line in said.splitlines())
    (segment,) = re.findall(r"demo-\d+", said)
    program = PROGRAM.format(segment=segment)
    assert all(f"    {line}" in said for line in program.splitlines() if line)
    plots = [line.partition("|")[2] for line in said.splitlines() if "|" in line]
    assert {"".join(plots[half]).count("#") > 30 for half in (slice(9), slice(9, 18))} == {True}
    assert "    1.00 |" in said  # the shoulder reached its target, the elbow its own
    assert "   -0.60 |" in said
    assert not [*tmp_path.iterdir()]  # the robot has stopped


def test_what_to_type_next_are_commands_of_o80() -> None:
    words = [command.split()[1] for command in NEXT]

    assert set(words) - {"--help"} <= set(COMMANDS)


def test_a_demo_of_no_package_is_an_error_that_lists_those_there_are() -> None:
    assert "unknown demo 'tenis', installed demos: " in run_o80("demo", "tenis", code=1).stderr


def test_a_chart_draws_both_curves_from_their_lowest_to_their_highest_value() -> None:
    seconds = np.linspace(0.0, 2.0, 600)
    ramp = np.linspace(0.0, 4.0, 600)

    lines = chart("joint", seconds, ramp, np.zeros(600))

    assert lines[0] == f"{'4.00':>9} |{' ' * 56}...."
    assert lines[4].startswith(f"{'joint':>9} |{' ' * 26}.")
    assert lines[8] == f"{'0.00':>9} |{'#' * 60}"
    assert lines[-1].split() == ["0", "2.0", "s"]


def test_a_chart_of_a_joint_that_stood_still_is_a_line() -> None:
    lines = chart("joint", np.arange(3.0), np.ones(3), np.ones(3))

    assert [line.count("#") for line in lines[:9]] == [60, *[0] * 8]
