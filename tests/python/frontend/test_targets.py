"""Targets: numbers, mappings, records, labels, and arrays of many rows."""

from collections.abc import Iterator
from enum import IntEnum
from typing import Any

import numpy as np
import pytest
from manual_backend import ManualBackend
from processes import WAIT

import o80


class Control(IntEnum):
    IDLE = 0
    POSITION = 1
    TORQUE = 5


JOINT = {
    "position": float,
    "gains": (np.float32, 2),
    "count": np.int8,
    "on": bool,
    "tool": {"size": float, "kind": Control},
}


@pytest.fixture
def robot(segment: str) -> Iterator[ManualBackend]:
    actuators = {
        "joints": (JOINT, ["a", "b"]),
        "mode": Control,
        "valve": bool,
        "gear": np.uint8,
        "drive": {"speed": float},
    }
    limits = {"a": {"position": (-1.0, 1.0)}}
    with ManualBackend(segment, actuators, limits=limits, units={"position": "rad"}) as made:
        yield made


def test_a_record_is_a_target(robot: ManualBackend) -> None:
    robot.desired("a", {"position": 0.5, "gains": (3, 4), "on": True})
    record = robot.frontend.latest().observed.joints[0]

    assert robot.desired("b", record).joints[1] == record
    robot.desired(["a", "b"], [0.0, 0.0])
    robot.frontend.add_trajectory(np.full((3, 2), record), ["a", "b"])
    robot.frontend.pulse()
    assert (robot.run(3).joints == record).all()


def test_a_first_field_that_is_no_number_takes_what_fits_it(segment: str) -> None:
    states = {"tool": {"kind": Control, "size": float}, "hand": {"fingers": (float, 3), "on": bool}}
    with ManualBackend(segment, states) as robot:
        assert robot.desired("tool", "TORQUE").tool.kind == Control.TORQUE
        assert robot.desired("tool", 1).tool.kind == Control.POSITION
        with pytest.raises(o80.InvalidArgument, match=r"'fingers'.*sequence of 3"):
            robot.frontend.add_command("hand", 0.5)


@pytest.mark.parametrize(
    ("actuator", "target", "desired"),
    [
        *(("mode", label, "TORQUE") for label in ("TORQUE", Control.TORQUE, 5, np.int64(5))),
        *(("valve", on, True) for on in (True, np.True_, 1, 1.0)),
        *(("gear", seven, 7) for seven in (7, 7.0, np.float64(7), np.uint8(7), np.array(7))),
        *(("a", one, {"position": 1.0}) for one in (1, 1.0, np.float32(1), np.int8(1), True)),
        ("a", {"gains": [1, 2]}, {"gains": [1.0, 2.0]}),
        ("a", {"tool": {"kind": "TORQUE"}}, {"tool": (2.0, Control.TORQUE)}),
        ([np.int64(0), "valve"], [{"position": 0.8}, True], {"position": 0.8}),
        ("a", (0.5, np.array([1, 2]), 3, True, (1.0, 5)), {"position": 0.5, "on": True}),
    ],
)
def test_a_value_is_given_in_each_form_that_it_has(
    robot: ManualBackend, actuator: Any, target: object, desired: Any
) -> None:
    """Fields that a target does not name keep what was desired."""
    robot.desired("a", {"gains": [3.0, 4.0], "count": 3, "tool": {"size": 2.0}})
    row = robot.desired(actuator, target)
    if not isinstance(desired, dict):
        assert row[actuator] == desired
        return
    kept = {"gains": [3.0, 4.0], "count": 3, "tool": (2.0, 0)}
    wanted = desired if isinstance(target, tuple) else kept | desired
    assert {name: row.joints[0][name].tolist() for name in wanted} == wanted


@pytest.mark.parametrize(
    ("actuator", "target", "text"),
    [
        ("mode", "FORCE", "IDLE, POSITION, TORQUE"),
        ("mode", 2, "IDLE, POSITION, TORQUE"),
        ("valve", 2, "valve.*True or False"),
        ("gear", 256, "gear.*0 to 255"),
        ("gear", 1.5, "gear.*integer"),
        ("a", "x", "'a'.*a number.*position, gains, count, on, tool"),
        ("a", 2.0, "'a'.*rad"),
        ("a", {"angle": 1}, "'a'.*angle.*position, gains, count, on, tool"),
        ("a", {"position": "x"}, "'position'.*'a'.*number"),
        ("a", {"gains": [1, 2, 3]}, "'gains'.*sequence of 2"),
        ("a", {"gains": [1, "x"]}, r"'gains'.*\[1\].*number"),
        ("a", {"tool": {"kind": "x"}}, "'kind' of 'tool'.*IDLE"),
        ("a", (1, 2), "all its fields in order"),
        ("a", {"position": float("nan")}, "position"),
        ("a", float("inf"), "target inf for"),
        ("a", None, "'a'"),
        ("drive", [1, 2], "'drive'"),
        ("drive", "fast", "'drive' must be a number, got 'fast'"),
        ("a", {}, "names no field"),
    ],
)
def test_a_refusal_names_the_actuator_the_field_and_what_there_is(
    robot: ManualBackend, actuator: str, target: object, text: str
) -> None:
    with pytest.raises(o80.InvalidArgument, match=text):
        robot.frontend.add_command(actuator, target)

    assert robot.frontend.added == 0


NOT_ONE_EACH = (
    0.5,
    [0.1],
    [0.1, 0.2, 0.3],
    "ab",
    {"shoulder": 1.0},
    np.array(0.5),
    np.zeros((1, 2)),
)


@pytest.mark.parametrize(
    ("actuators", "targets", "message"),
    [
        ([], [], "at least one actuator"),
        (["shoulder", "hand"], [0.1, 0.2], "'hand'"),
        ([0, 7], [0.1, 0.2], "7"),
        ([0, 1.5], [0.1, 0.2], "by its index or its name"),
        (["shoulder", "elbow"], [0.1, float("nan")], "'elbow'"),
        (["elbow", 1], [0.1, 0.2], "'elbow' is named twice"),
        (["shoulder", "elbow"], [0.1, "far"], "'elbow'"),
        (["shoulder", "elbow"], [[0.1, 0.2], [0.3, 0.4]], "'shoulder'"),
        *((["shoulder", "elbow"], wrong, "target for each") for wrong in NOT_ONE_EACH),
    ],
)
def test_one_that_cannot_be_refuses_all(
    arm: o80.Frontend, actuators: list[str | int], targets: object, message: str
) -> None:
    with pytest.raises(o80.InvalidArgument, match=message):
        arm.add_command(actuators, targets)
    assert arm.added == 0


@pytest.mark.parametrize(
    ("options", "last", "third"),  # iteration of the last row, place in iteration 3
    [
        ({}, 2, None),
        ({"iterations": 4}, 8, 0.7119140625),
        ({"iterations": 4, "profile": "monotone"}, 8, 0.703125),
        ({"iterations": 4, "profile": "linear"}, 8, 0.75),
        ({"iterations": 4, "profile": "hold"}, 8, 1.0),
        ({"speed": 250.0}, 8, 0.75),
        ({"times": [0.004, 0.010]}, 10, None),
    ],
)
def test_a_trajectory_takes_its_pace_and_profile(
    arm: o80.Frontend, options: dict[str, Any], last: int, third: float | None
) -> None:
    arm.add_trajectory([1.0, 2.0], "elbow", **options)
    assert arm.added == 1, "one command"
    assert arm.pulse_and_wait(timeout=WAIT).iteration == last
    arm.burst(1)
    assert arm.history().desired[-1].tolist() == [0.0, 2.0]
    assert third is None or arm.history().desired[3, 1] == third


def test_profiles_of_rows_are_refused_where_they_cannot_be(arm: o80.Frontend) -> None:
    with pytest.raises(o80.InvalidArgument, match="smooth needs rows that are due in fixed iter"):
        arm.add_trajectory([1.0, 2.0], "elbow", speed=250.0, profile="smooth")
    with pytest.raises(o80.InvalidArgument, match="'minimum_jerk', got 'as_sent'"):
        arm.add_trajectory([1.0, 2.0], "elbow", profile="as_sent")
    assert arm.added == 0


@pytest.mark.parametrize(
    ("targets", "options", "text"),
    [
        (np.zeros((10, 3)), {}, r"\(T, 2\)"),
        (np.zeros((0, 2)), {}, "no row"),
        ([["a", "b"]], {}, "cannot be read"),
        (np.zeros((2, 2)), {"times": [0.1]}, "times"),
        (np.zeros((1, 2)), {"times": []}, "one for each row"),
        (np.zeros((1, 2)), {"times": [0.0]}, "grow .*: row 0 is due after 0 s, the start"),
        (np.zeros((2, 2)), {"times": [0.1, float("nan")]}, "finite"),
        (np.zeros((2, 2)), {"times": [0.1, 0.2], "iterations": 1}, "one pace"),
        (np.zeros((2, 2)), {"iterations": 1, "speed": 1.0}, "one pace"),
        (np.zeros((2, 2)), {"iterations": 0}, "iterations must be from 1"),
        ([[0.0, 0.0], [0.0, 9.0]], {}, "elbow"),
        (np.full((2, 2), np.nan), {}, "shoulder"),
        ({"position": [0.0]}, {}, "no actuator, group or field is named 'position'"),
        ({}, {}, "lack 'shoulder', 'elbow'"),
    ],
)
def test_a_trajectory_is_added_whole_or_not_at_all(
    arm: o80.Frontend, targets: object, options: dict[str, object], text: str
) -> None:
    with pytest.raises(o80.InvalidArgument, match=text):
        arm.add_trajectory(targets, **options)  # type: ignore[arg-type]

    assert arm.added == 0


def test_a_trajectory_of_chosen_actuators(arm: o80.Frontend) -> None:
    arm.add_trajectory([[1.0, 2.0]], ["elbow", 0])

    assert arm.pulse_and_wait(timeout=WAIT).desired.tolist() == [2.0, 1.0]


@pytest.mark.parametrize("single", [False, True])
def test_a_trajectory_takes_the_forms_of_a_command(robot: ManualBackend, single: bool) -> None:
    """Each row does what a command with the same target does; other fields keep their values."""
    named = "a" if single else ["a", "b"]
    count = () if single else (2,)
    robot.desired("a", {"gains": [3.0, 4.0], "count": 5, "on": True})
    forms: list[Any] = [0.25, {"position": 0.5}, {"count": 7}, {"position": 0.5, "on": False}]
    for form in forms:
        rows = (
            {name: np.full((3, *count), value) for name, value in form.items()}
            if isinstance(form, dict)
            else np.full((3, *count), form).tolist()
        )
        robot.frontend.add_trajectory(rows, named)
        robot.frontend.pulse()
        last = robot.run(3)
        by_trajectory = last.joints[["position", "gains", "count", "on"]].copy()
        robot.frontend.add_command(named, form if single else [form, form], iterations=3)
        robot.frontend.pulse()
        last = robot.run(3)
        assert np.array_equal(by_trajectory, last.joints[["position", "gains", "count", "on"]])
        expected = form if isinstance(form, dict) else {"position": form}
        for name, value in expected.items():
            assert by_trajectory[name][0] == value
    assert by_trajectory["gains"][0].tolist() == [3.0, 4.0]
    assert not by_trajectory["gains"][1].any()


def test_a_trajectory_names_fields_that_there_are(robot: ManualBackend) -> None:
    with pytest.raises(o80.InvalidArgument, match=r"'positoin'\. Did you mean 'position'"):
        robot.frontend.add_trajectory({"positoin": np.zeros((3, 2))}, ["a", "b"])
    with pytest.raises(o80.InvalidArgument, match=r"'a' has no field 'positoin'; there are: po"):
        robot.frontend.add_trajectory({"joints": {"positoin": [[0, 0]]}})
    with pytest.raises(o80.InvalidArgument, match=r"lack 'a', 'b'"):
        robot.frontend.add_trajectory({}, ["a", "b"])
    with pytest.raises(o80.InvalidArgument, match=r"\(T, 2\), got \(\)"):
        robot.frontend.add_trajectory(0.5, ["a", "b"])
    assert robot.frontend.added == 0


def test_a_trajectory_across_types_gives_each_its_first_field(robot: ManualBackend) -> None:
    rows: Any = [[0.1, 0.2, "TORQUE", True, 3, 0.5], [0.3, 0.4, 0, False, 4, 0.6]]
    robot.frontend.add_trajectory(rows)
    robot.frontend.add_command("joints", [0.7, 0.8])
    robot.frontend.pulse()
    first, second, third = (robot.run() for _ in range(3))

    assert first.joints["position"].tolist() == [0.1, 0.2]
    assert (first.mode, first.valve, first.gear, first.drive.speed) == ("TORQUE", True, 3, 0.5)
    assert (int(second.mode), second.valve, second.gear, second.drive.speed) == (0, False, 4, 0.6)
    assert third.joints["position"].tolist() == [0.7, 0.8]


def test_a_path_is_the_name_of_a_number_in_rows_too(robot: ManualBackend) -> None:
    robot.frontend.add_trajectory({"a.position": [0.5], "b.count": [7]}, ["a", "b"])
    robot.frontend.pulse()
    robot.run()
    row, history = robot.frontend.latest(), robot.frontend.history()

    assert (row["desired.a.position"], row["desired.b.count"]) == (0.5, 7)
    assert row["desired.valve"] == row.desired.valve
    assert history["desired.a.position"].tolist() == [0.0, 0.5]
    assert history["desired.drive"].shape == (2,)
    for path in ("desired.c", "desired.\udcff"):
        with pytest.raises(o80.InvalidArgument, match=f"a row has no number '{path}'"):
            row[path]
    with pytest.raises(TypeError):
        iter(row)  # type: ignore[call-overload]
