"""Histories outlive a session: NumPy, pickle, HDF5 and pandas."""

import io
import pickle
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mixed_robots import GROUPS, ROBOTS, SENSORS, Mode, recorded

import o80


@ROBOTS
@given(GROUPS, SENSORS, st.integers(0, 2**32 - 1))
def test_rows_of_any_robot_are_saved_and_loaded(groups: Any, sensors: Any, seed: int) -> None:
    history = recorded(groups, sensors, seed)
    file = io.BytesIO()
    np.save(file, history.rows)
    file.seek(0)
    loaded = np.load(file)

    assert loaded.dtype.names == history.rows.dtype.names
    for name in loaded.dtype.names:
        # as values: padding is not kept
        assert repr(loaded[name].tolist()) == repr(history.rows[name].tolist())


@ROBOTS
@given(GROUPS, SENSORS, st.integers(0, 2**32 - 1))
def test_histories_of_any_robot_are_pickled(groups: Any, sensors: Any, seed: int) -> None:
    history = recorded(groups, sensors, seed)
    copy = pickle.loads(pickle.dumps(history))

    assert copy.rows.tobytes() == history.rows.tobytes()
    assert str(copy[-1]) == str(history[-1])
    assert pickle.loads(pickle.dumps(history[1:3])).iteration.tolist() == [1, 2]


@ROBOTS
@given(GROUPS, SENSORS, st.integers(0, 2**32 - 1))
def test_frames_of_any_robot_hold_all_numbers(groups: Any, sensors: Any, seed: int) -> None:
    history = recorded(groups, sensors, seed)
    frame = history.to_frame()

    assert frame.index.tolist() == history.iteration.tolist()
    observed = frame[[name for name in frame if name.startswith(("observed.", "extended"))]]
    numbers = observed.apply(_as_number).to_numpy(np.float64)
    assert np.array_equal(numbers, history.flat(np.float64))


def _as_number(column: Any) -> Any:
    return column.map(lambda label: int(Mode[label])) if column.dtype == "category" else column


def test_a_frame_names_parts_actuators_and_fields() -> None:
    groups = {"joints": ({"position": float, "mode": Mode}, ["left", "right"]), "grip": float}
    frame = recorded(groups, {"force": (float, 2)}, 0).to_frame()

    assert frame.index.name == "iteration"
    assert {
        "time",
        "halted",
        "desired.left.position",
        "observed.right.mode",
        "observed.grip",
    } < set(frame.columns)
    assert {"extended.force[0]", "extended.force[1]", "active.left", "braking.grip"} < set(
        frame.columns
    )
    assert set(frame["observed.right.mode"].cat.categories) == {"IDLE", "MOVE", "HOLD"}


def test_an_empty_history_is_saved_too(arm: o80.Frontend) -> None:
    empty = arm.history(0)
    assert len(empty.to_frame()) == 0
    assert "observed.elbow" in empty.to_frame()
    file = io.BytesIO()
    np.save(file, empty.rows)
    assert len(pickle.loads(pickle.dumps(empty))) == 0


def test_hdf5_takes_the_rows(arm: o80.Frontend, tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    arm.burst(20)
    history = arm.history()
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file["rows"] = history.rows
    with h5py.File(tmp_path / "run.h5") as file:
        assert np.array_equal(file["rows"]["observed"], history.observed)


def test_a_history_itself_is_saved(arm: o80.Frontend, tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    arm.add_command("elbow", 0.3, iterations=20)
    arm.burst(20)
    history = arm.history()
    np.save(tmp_path / "run.npy", history)
    np.savez(tmp_path / "run.npz", run=history, rest=history[10:])
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file["rows"] = history
    with h5py.File(tmp_path / "run.h5") as file:
        stored = file["rows"][:]
    loaded = np.load(tmp_path / "run.npz")
    for rows in (np.load(tmp_path / "run.npy"), loaded["run"], stored):
        assert np.array_equal(rows["desired"], history.desired)
        assert np.array_equal(rows["iteration"], history.iteration)
    assert len(loaded["rest"]) == 11


def test_every_second_row_has_all_numbers(arm: o80.Frontend) -> None:
    arm.add_command("elbow", 0.3, iterations=20)
    arm.burst(20)
    history = arm.history()
    assert np.array_equal(history[::2].flat(), history.flat()[::2])
    assert history[::2].to_frame().equals(history.to_frame()[::2])


def test_without_pandas_the_error_names_the_extra(
    arm: o80.Frontend, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(o80.MissingExtra, match=r'pip install "o80\[pandas\]"') as missing:
        arm.history().to_frame()
    assert isinstance(missing.value, ImportError)
