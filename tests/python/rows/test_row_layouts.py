"""Rows of any layout, with padding at any place: all that reads them sees what was published.

`O80_LAYOUTS=1000` tries more layouts than the usual few.
"""

import os
import pickle
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import published_rows
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mixed_robots import GROUPS, ROBOTS, SENSORS, Mode, recorded
from published_rows import Published, check_every_reader

import o80
from o80.drivers import Reading
from o80.recording.message_types import row_type
from o80.rows.layout import field_view, with_padding
from o80.rows.targets import states_of

LAYOUTS = settings(ROBOTS, max_examples=int(os.environ.get("O80_LAYOUTS", ROBOTS.max_examples)))
SEEDS = st.integers(0, 2**32 - 1)


def padded(segment: str) -> o80.Backend:
    """A robot whose rows have padding in the middle and at the end."""
    sensors = {"warm": bool, "heat": float, "on": bool}
    return o80.Backend(segment, ["left", "right"], extended=sensors)


@LAYOUTS
@given(groups=GROUPS, sensors=SENSORS, seed=SEEDS)
def test_every_reader_sees_what_an_embedded_backend_published(
    groups: Any, sensors: Any, seed: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    published = Published(groups, sensors, seed)
    name = f"test-layout-{os.getpid()}"
    with o80.Backend(name, groups, extended=sensors, bursting=True) as backend:
        backend.publish(*published.row(0))
        with o80.Frontend(name) as frontend:

            def iterate() -> None:
                frontend.burst(1, wait=False)
                backend.step()
                backend.publish(*published.row(frontend.published + 1))

            folder = tmp_path_factory.mktemp("backend")
            check_every_reader(frontend, iterate, published.columns, folder)


class Publisher:
    """A simulated robot of a layout that a test sets."""

    name = "publisher"
    simulated = True
    requests = {  # noqa: RUF012  what a simulation serves that is replayed with its driver
        "reset": {"seed": np.uint64},
        "snapshot": {"slot": np.uint32},
        "restore": {"slot": np.uint32},
    }
    rows: Published

    def read(self, reading: Reading) -> None:
        states, sensors = self.rows.row(reading.iteration)
        reading.observed = states
        if sensors is not None:
            reading.extended = sensors

    def on_reset(self, fields: Any) -> None: ...
    def on_snapshot(self, fields: Any) -> None: ...
    def on_restore(self, fields: Any) -> None: ...


# where a replay finds it
Publisher.__module__ = published_rows.__name__
published_rows.Publisher = Publisher  # type: ignore[attr-defined]


@LAYOUTS
@given(groups=GROUPS, sensors=SENSORS, seed=SEEDS)
def test_every_reader_sees_what_a_driver_in_python_published(
    groups: Any, sensors: Any, seed: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    published = Published(groups, sensors, seed)
    Publisher.rows = published
    Publisher.actuators, Publisher.extended = groups, sensors  # type: ignore[attr-defined]
    folder = tmp_path_factory.mktemp("driver")
    robot = o80.robots.load(Publisher)
    with robot.inline(f"test-layout-{os.getpid()}") as frontend:
        check_every_reader(frontend, lambda: frontend.burst(1), published.columns, folder)
        report = o80.replay(frontend, robot="published_rows:Publisher")
        assert report.identical, report
    report = o80.replay(folder / "run.mcap", robot="published_rows:Publisher")
    assert report.identical, report
    Publisher.rows = Published(groups, sensors, seed)
    Publisher.rows.swap(5, 6)
    (run,) = o80.replay(folder / "run.mcap", robot="published_rows:Publisher")
    before, after = published.columns(8), Publisher.rows.columns(8)
    changed = [name for name in before if before[name][5].tobytes() != after[name][5].tobytes()]
    found = run.difference and (run.difference.iteration, run.difference.field)
    assert found == ((5, changed[0]) if changed else None)


def test_an_enumeration_has_constants_and_a_field_its_unit(arm: o80.Frontend) -> None:
    text = row_type(recorded({"hand": {"mode": Mode}}, None, 1)._layout).definition

    assert "int64 MODE_HOLD=-2" in text
    assert "# what is asked less what is there [rad]" in row_type(arm._layout).definition


def test_names_become_valid_in_messages_and_stay_different() -> None:
    history = recorded({"Left Hand": "f8", "left-hand": "f8", "3rd": "f8"}, None, 2)
    text = row_type(history._layout).definition
    names = {line.split()[1] for line in text.splitlines() if line.startswith("float64")}

    assert {"left_hand", "left_hand_2", "x_3rd"} <= names


def test_rows_without_their_padding_are_no_history(segment: str) -> None:
    with padded(segment) as backend:
        backend.publish([0.1, 0.2], {"warm": True, "heat": 20.0, "on": True})
        with o80.Frontend(segment) as frontend:
            history = frontend.history()
    for rows in (np.concatenate([history.rows]), np.where([True], history.rows, history.rows)):
        with pytest.raises(o80.InvalidArgument, match=r"drop padding.*history\.observed"):
            o80.History(history._decoder, rows)
    copy = pickle.loads(pickle.dumps(history))
    assert copy.extended.heat.tolist() == [20.0]
    o80.History(copy._decoder, history.rows)


def test_a_view_of_fields_side_by_side_holds_their_numbers() -> None:
    joints = np.dtype([("position", "f8", (3,)), ("velocity", "f8", (3,)), ("on", "?")], align=True)
    rows = np.zeros((2, 4), [("iteration", "i8"), ("joints", joints)])
    view = field_view(rows[:, -1], "joints.position", "joints.velocity")
    rows["joints"]["velocity"][1, -1] = [1.0, 2.0, 3.0]
    assert view.tolist() == [[0.0] * 6, [0.0, 0.0, 0.0, 1.0, 2.0, 3.0]]
    assert field_view(rows, "iteration").shape == (2, 4, 1)
    with pytest.raises(o80.InvalidArgument, match="'angle' is none of position, velocity, on"):
        field_view(rows, "joints.angle")
    for paths in (("joints",), ("joints.velocity", "joints.position")):
        with pytest.raises(o80.InvalidArgument, match="must be of one type"):
            field_view(rows, *paths)


def after_other_values(copied: Callable[[], Any]) -> Any:
    """Result of a call in memory that held something before."""
    used = [np.full(32 << i % 16, 255, np.uint8) for i in range(320)]
    del used
    return copied()


def test_copies_of_rows_have_the_padding_of_the_rows(arm: o80.Frontend) -> None:
    arm.burst(50)
    history = arm.history()
    times, half = history.time[::2], with_padding(history.rows)[::2].tobytes()
    copies = {
        "pickled": lambda: pickle.loads(pickle.dumps(history[::2])).rows,
        "linear": lambda: o80.align({"arm": history}, at=times, how="linear")["arm"].rows,
        "before": lambda: o80.align({"arm": history}, at=times)["arm"].rows,
    }
    for how, copied in copies.items():
        assert after_other_values(copied).tobytes() == half, how


def test_padding_of_targets_is_zero(segment: str) -> None:
    with o80.Backend(segment, ["left", "right"], {"on": bool, "position": float}) as backend:
        for count in (2, 20, 200):
            targets = np.zeros((count, 2), [("on", bool), ("position", float)])
            for given in (targets, {name: targets[name] for name in ("on", "position")}):
                copied = partial(states_of, given, [0, 1], backend._layout)
                states, *_ = after_other_values(copied)
                assert not states.any()
