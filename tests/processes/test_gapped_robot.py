"""A robot in C++ with padding at many places: all that reads its rows sees what it published."""

import os
from enum import IntEnum
from pathlib import Path

import numpy as np
from published_rows import Columns, Published, check_every_reader

import o80

NUMBERS = 97  # of robots/gapped.cpp


class ControlMode(IntEnum):
    OFF = 0
    POSITION = 3
    TORQUE = 4


# as in tests/cpp/describe/described.hpp
JOINT = {"position": float, "velocity": float}
PADDED = np.dtype([("small", "u1"), ("large", float), ("middle", "i2")])
GROUPS = {
    "joints": (JOINT, 7),
    "gripper": {"width": np.float32, "closed": bool},
    "mode": ControlMode,
}
SENSORS = {
    "force": (float, 3),
    "matrix": (np.float32, (4, 2)),
    "nested": JOINT,
    "padded": (PADDED, 2),
    "mode": ControlMode,
    "count": np.int64,
}


def counted(rows: int) -> Columns:
    """All numbers of so many rows, as the robot counts them."""
    columns = Published(GROUPS, SENSORS, 0).columns(rows)
    names = [name for name in columns if not name.startswith("desired.")]
    for i, name in enumerate(names):
        numbers = (7 * np.arange(rows) + i) % NUMBERS
        if name.endswith("mode"):
            numbers = np.array([*ControlMode])[numbers % 3]
        elif name.endswith("closed"):
            numbers = numbers % 2
        columns[name] = numbers.astype(columns[name].dtype)
        if name.startswith("observed."):
            first = columns[name][:1]
            columns[name.replace("observed.", "desired.", 1)] = np.repeat(first, rows)
    return columns


def test_every_reader_sees_what_it_published(build_prefix: Path, tmp_path: Path) -> None:
    robot = build_prefix / "lib" / "tests" / "gapped.so"
    with o80.robots.load(robot).inline(f"test-{os.getpid()}-gapped") as frontend:
        check_every_reader(frontend, lambda: frontend.burst(1), counted, tmp_path)
        assert o80.replay(frontend).identical
    assert o80.replay(tmp_path / "run.mcap", robot=robot).identical
