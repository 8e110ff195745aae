"""Histories outlive a session: NumPy, pickle, HDF5 and pandas."""

import io
import pickle
import sys
from pathlib import Path

import numpy as np
import pytest
from mixed_robots import Mode, recorded

import o80


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


def test_without_pandas_the_error_names_the_extra(
    arm: o80.Frontend, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(o80.MissingExtra, match=r'pip install "o80\[pandas\]"') as missing:
        arm.history().to_frame()
    assert isinstance(missing.value, ImportError)
