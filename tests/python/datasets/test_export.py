"""Rows in formats of other tools, and as plots."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mixed_robots import Mode, recorded
from processes import run_o80

import o80
from o80.cli.histories import histories
from o80.datasets.export import write
from o80.joining.plot import origins
from o80.plot import plot
from o80.rows.journal import command_ends


def test_columns_are_chosen_by_the_names_of_fields(arm: o80.Frontend, tmp_path: Path) -> None:
    arm.burst(3)
    path = tmp_path / "rows.csv"

    write(path, {"arm": arm.history()}, ["observed.elbow", "effort"])
    head = path.read_text().splitlines()[0]
    assert head == "iteration,time,observed.elbow,extended.effort[0],extended.effort[1]"
    with pytest.raises(o80.InvalidArgument, match=r"no field 'elbwo'.*Did you mean 'elbow'"):
        write(path, {"arm": arm.history()}, ["elbwo"])


def test_formats_that_do_not_fit_are_named(arm: o80.Frontend, tmp_path: Path) -> None:
    history = arm.history()
    with pytest.raises(o80.InvalidArgument, match=r"unknown format '\.xls'.*\.npz, \.h5"):
        write(tmp_path / "rows.xls", {"arm": history})
    with pytest.raises(o80.InvalidArgument, match="one table, but there are 2: a, b"):
        write(tmp_path / "rows.parquet", {"a": history, "b": history})


def panels(figure: Any) -> list[str]:
    return [axes.get_ylabel() for axes in figure.axes]


def test_desired_and_observed_share_a_panel_and_a_halt_is_shaded(arm: o80.Frontend) -> None:
    arm.add_command("elbow", 0.5, iterations=10)
    arm.burst(10)
    arm.halt("enough")
    arm.burst(5)
    figure = plot({"arm": arm.history()})
    labels = [line.get_label() for line in figure.axes[1].get_lines()]
    elbow = figure.axes[1].get_lines()[1]

    assert panels(figure) == ["shoulder\n[rad]", "elbow\n[rad]"]
    assert labels == ["desired", "observed"]
    assert np.array_equal(elbow.get_ydata(), arm.history().observed[:, 1])
    assert np.array_equal(elbow.get_xdata(), arm.history().time * 1e-9)
    assert len(figure.axes[1].patches) == 1


@pytest.mark.parametrize(
    ("fields", "shown"),
    [
        (["elbow"], ["elbow\n[rad]"]),
        (["observed.elbow"], ["elbow\n[rad]"]),
        (
            ["extended"],
            ["extended.homing", "extended.effort[0]\n[rad]", "extended.effort[1]\n[rad]"],
        ),
        (["effort[1]"], ["extended.effort[1]\n[rad]"]),
    ],
)
def test_fields_choose_panels(fields: list[str], shown: list[str], arm: o80.Frontend) -> None:
    assert panels(plot({"arm": arm.history()}, fields)) == shown


def test_too_many_panels_are_refused(arm: o80.Frontend) -> None:
    many = {f"arm-{i}": arm.history() for i in range(20)}
    with pytest.raises(o80.InvalidArgument, match="40 panels are too many"):
        plot(many)


def test_marks_are_drawn_in_their_run_where_they_were_made(path: Path) -> None:
    for text, rows in (("first $x", 100), ("second", 50)):
        with (
            o80.robots.load("two_joints").inline("arm") as arm,
            o80.Recording(path, arm, proceed=path.exists()) as recording,
        ):
            arm.burst(rows)
            recording.mark(text)
            arm.burst(100)

    runs = list(histories(str(path), None))
    assert [run.marks for run in runs] == [[("first $x", 100)], [("second", 50)]]
    for run in runs:
        figure = plot({"arm": run.history}, marks={"arm": [*run.marks, ("earlier", -1)]})
        for axes in figure.axes:
            assert [text.get_text() for text in axes.texts] == [name for name, _ in run.marks]
            places = [text.get_position()[0] for text in axes.texts]
            assert places == pytest.approx([row * 1e-3 for _, row in run.marks])


def test_an_enumeration_has_its_labels_at_the_axis() -> None:
    figure = plot({"hand": recorded({"hand": {"mode": Mode}}, None, 3)})

    assert [text.get_text() for text in figure.axes[0].get_yticklabels()] == [
        "IDLE",
        "MOVE",
        "HOLD",
    ]


def test_the_commands_write_files(arm: o80.Frontend, path: Path, tmp_path: Path) -> None:
    with o80.Recording(path, arm):
        arm.burst(20)
    for words, said in (
        (["plot", path, "-o", tmp_path / "run.png"], "21 rows"),
        (["plot", arm.segment, "--seconds", "0.005", "-o", tmp_path / "live.png"], "5 rows"),
        (["export", path, "-o", tmp_path / "run.npz"], "21 rows"),
    ):
        assert said in run_o80(*words).stdout

    assert (tmp_path / "run.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "live.png").stat().st_size > 1000
    assert len(np.load(tmp_path / "run.npz")[f"{arm.segment}/time"]) == 21


def ends_in(figure: Any, panel: int) -> set[str]:
    """Labels of the marks for ends of commands in a panel."""
    labels = (str(line.get_label()) for line in figure.axes[panel].get_lines())
    return {label for label in labels if label.startswith("command ")}


def test_ends_of_commands_are_marked_in_the_panels_of_their_actuators(arm: o80.Frontend) -> None:
    arm.add_command("shoulder", 0.2, iterations=10)
    arm.burst(5)
    arm.add_command("shoulder", 0.1, iterations=10, mode="overwrite")
    arm.add_command("elbow", 0.3, iterations=20)
    arm.burst(15)
    history = arm.history()
    figure = plot({"arm": history}, ends={"arm": command_ends(arm.journal())})

    assert ends_in(figure, 0) == {"command overwritten", "command completed"}
    assert ends_in(figure, 1) == set()
    arm.burst(10)
    ends = command_ends(arm.journal())
    figure = plot({"arm": arm.history()}, ends={"arm": ends})
    assert ends_in(figure, 1) == {"command completed"}
    (line,) = [
        each for each in figure.axes[1].get_lines() if each.get_label() in ends_in(figure, 1)
    ]
    (end,) = [each for each in ends if each.actuators == ("elbow",)]
    assert np.asarray(line.get_xdata())[0] == pytest.approx(
        arm.history().at_iteration(end.iteration).time * 1e-9
    )
    # ends outside the rows are not drawn
    assert ends_in(plot({"arm": arm.history(3)}, ends={"arm": ends}), 0) == set()


def test_a_rejected_batch_ends_its_commands(arm: o80.Frontend) -> None:
    arm.burst(10)
    arm.add_command("elbow", 0.3)
    arm.pulse(at=3)
    arm.burst(1)
    assert [end.status for end in command_ends(arm.journal())] == [o80.Status.REJECTED]


DAY = 86_400_000_000_000  # [ns]


def test_runs_of_different_days_begin_at_zero_each() -> None:
    history = recorded({"joints": ({"position": "f8"}, 1)}, {}, 5)
    first = int(history.time[0])
    runs = {
        "arm": (history, 1000),
        "ball": (history, 1000 + 5_000_000),
        "arm/1": (history, 1000 + DAY),
        "live": (history, None),
    }
    zeros, axes = origins(runs)

    assert axes == 3
    assert zeros["arm"] == first
    assert zeros["ball"] == first - 5_000_000  # the same axis, 5 ms later
    assert zeros["arm/1"] == first
    assert zeros["live"] == first
    figure = plot(dict.fromkeys(runs, history), origins=zeros)
    begins = [np.asarray(ax.get_lines()[0].get_xdata())[0] for ax in figure.axes]
    assert begins == pytest.approx([0, 0.005, 0, 0])
