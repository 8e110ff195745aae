"""The typed module of a robot: type checkers accept its names and refuse others."""

import ast
import os
import runpy
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mixed_robots import GROUPS, ROBOTS, SENSORS
from processes import run_o80
from test_typing import mypy

import o80
from o80.frontend.robot_stub import digest_of, module_of


class Gear(IntEnum):
    LOW = 0
    HIGH = 1


class Crane:
    """A robot of several types, which is only described."""

    actuators = {  # noqa: RUF012
        "arm": ({"position": float, "gear": Gear}, ["shoulder", "elbow"]),
        "hook": float,
        "gear": Gear,
    }
    extended = {"status": Gear, "force": ("f8", (3,)), "cable": {"length": float}}  # noqa: RUF012
    requests = {"home": None, "swing": {"angle": float, "gear": Gear}}  # noqa: RUF012

    def read(self, reading: Any) -> None: ...
    def on_home(self, fields: Any) -> None: ...
    def on_swing(self, fields: Any) -> None: ...


class Camera:
    """A robot without actuators and requests, with names that no variable may have."""

    extended = {"class": float, "left x": int}  # noqa: RUF012

    def read(self, reading: Any) -> None: ...


GOOD = """
from typing import assert_type

import numpy as np
import o80
from numpy.typing import NDArray
from my_camera import attach as attach_camera
from my_crane import Actuator, Crane, attach
from my_joints import attach as attach_joints


def use(name: Actuator = "elbow") -> None:
    with attach() as crane:
        assert_type(crane, Crane)
        crane.add_command("elbow", 0.5, duration=2.0, mode="overwrite")
        crane.add_command("elbow", {"position": 0.5, "gear": "HIGH"})
        crane.add_command("gear", "LOW")
        crane.add_command("gear", 1)
        crane.add_command(np.int64(2), 0.5)
        crane.add_command(["hook", "elbow"], [0.1, 0.2], speed=1.0)
        crane.add_trajectory(np.zeros((5, 1)), ["hook"])
        crane.add_request("home")
        crane.request("swing", angle=0.5, gear="LOW", timeout=3.0)
        crane.move_to("hook", 0.2, tolerance=0.1)
        assert_type(crane.pulse(), o80.Batch)
        row = crane.pulse_and_wait(timeout=5.0)
        assert_type(row.observed.hook, float)
        assert_type(row.extended.force, NDArray[np.float64])
        assert_type(row.extended.cable.length, float)
        print(row.observed.arm["position"], row.observed.arm[0], row.extended["status"])
        if row.extended.status == "LOW" and row.observed.gear != "HIGH":
            print(crane.initial_states.hook)
        for each in crane.stream():
            assert_type(each.observed.hook, float)
        history = crane.history(seconds=1.0)
        assert_type(history.observed.hook, NDArray[np.float64])
        assert_type(history[1:].extended.cable.length, NDArray[np.float64])
        assert_type(history[0].observed.hook, float)
        crane.purge(name)
    with attach_joints("other", read_only=True) as joints:
        joints.request("reset", seed=3)
        joints.request("home")
        assert_type(joints.latest().observed, NDArray[np.float64])
        assert_type(joints.burst(3).extended.homing, bool)
        assert_type(joints.burst(3, wait=False), o80.Burst)
    with attach_camera() as camera:
        print(camera.latest().extended["left x"])
"""
BAD = [
    'crane.add_command("elbov", 0.5)',
    'crane.add_command("elbow", {"angle": 0.5})',
    'crane.add_command("gear", "MIDDLE")',
    'crane.add_command("hook", "LOW")',
    'crane.add_command(["hook", "elbov"], [0.1, 0.2])',
    'crane.add_command("elbow", 0.5, seconds=2.0)',
    'crane.purge("elbov")',
    'crane.add_request("hom")',
    'crane.request("swing", angle=0.5, gear="MIDDLE")',
    'crane.request("swing", angel=0.5, gear="LOW")',
    'crane.request("swing", gear="LOW")',
    "crane.latest().observed.hok",
    'crane.latest().observed.arm["positon"]',
    "crane.latest().extended.forse",
    'print(crane.latest().extended.status == "MIDDLE")',
    "crane.history().extended.cable.lenght",
    "crane.history()[0].observed.hok",
    'camera.request("home")',
    'camera.latest().extended["left y"]',
]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with modules of three robots that do not run."""
    described = {
        "my_joints": o80.robots.load("two_joints").describe(),
        "my_crane": o80.robots.load(Crane).describe(),
        "my_camera": o80.robots.load(Camera).describe(),
    }
    for name, schema in described.items():
        (tmp_path / f"{name}.py").write_text(module_of(schema))
    return tmp_path


def test_a_type_checker_accepts_names_of_the_robot_and_refuses_others(folder: Path) -> None:
    program = "from my_camera import Camera\nfrom my_crane import Crane\n\n\n"
    program += "def use(crane: Crane, camera: Camera) -> None:\n"
    good, bad = mypy(folder, GOOD, program + "".join(f"    {line}\n" for line in BAD))
    assert not good
    flagged = {int(line.split(":")[0]) for line in bad if ": error:" in line}
    missed = [line for number, line in enumerate(BAD, start=6) if number not in flagged]
    assert not missed, bad
    said = "\n".join(bad)
    assert "my_" not in said.replace("my_crane.", "").replace("my_camera.", ""), said


def attach_of(path: Path) -> Any:
    return runpy.run_path(str(path))["attach"]


@ROBOTS
@given(groups=GROUPS, sensors=SENSORS)
def test_the_module_of_any_robot_attaches_to_it(
    groups: Any, sensors: Any, tmp_path_factory: pytest.TempPathFactory
) -> None:
    name = f"test-stub-{os.getpid()}"
    file = tmp_path_factory.mktemp("stub") / "robot.py"
    with o80.Backend(name, groups, extended=sensors, requests={"go": {"name": Gear}}) as backend:
        backend.publish()
        file.write_text(module_of(backend.schema, name))
        with attach_of(file)(read_only=True) as frontend:
            assert frontend.segment == name


def test_a_module_refuses_another_robot(folder: Path, segment: str) -> None:
    attach = attach_of(folder / "my_crane.py")
    with o80.Backend(segment, ["left"]) as backend:
        backend.publish()
        with pytest.raises(o80.SchemaMismatch, match=f"make it again with `o80 stub {segment}`"):
            attach(segment)


def test_units_do_not_make_it_another_robot_and_types_do(segment: str) -> None:
    def digest(dtype: Any, unit: str) -> str:
        with o80.Backend(segment, ["a"], {"x": dtype}, units={"x": unit}) as backend:
            return digest_of(backend.schema)

    assert digest(float, "m") == digest(float, "mm") != digest(int, "m")


@pytest.mark.parametrize("name", ["Actuator", "any", "Mapping", "Row"])
def test_a_robot_may_be_called_as_what_its_module_uses(name: str, segment: str) -> None:
    with o80.Backend(segment, {name: ({"x": float}, 2)}, robot=name) as backend:
        tree = ast.parse(module_of(backend.schema, segment))
    made = [each.name for each in ast.walk(tree) if isinstance(each, ast.ClassDef)]
    assert len(made) == len({*made})
    assert not {"Actuator", "Any", "Mapping", "Literal"} & {*made}


def test_the_command_writes_the_module_of_a_robot_or_a_segment(
    arm: o80.Frontend, tmp_path: Path
) -> None:
    printed = run_o80("stub", "two_joints").stdout
    run_o80("stub", arm.segment, "-o", tmp_path / "mine.py")

    assert "Literal['shoulder', 'elbow']" in printed
    with attach_of(tmp_path / "mine.py")() as frontend:
        assert frontend.segment == arm.segment
        frontend.add_command("elbow", np.float64(0.1))
        frontend.forget_added()
    assert "Did you mean" in run_o80("stub", "two_joint", code=1).stderr
    nowhere = run_o80("stub", "pam", "-o", "/no/x.py", code=1)
    assert nowhere.stderr == "o80: /no/x.py cannot be written: there is no folder /no\n"


PIECES = st.sampled_from(['"""', "'", "\\", "{0}", "#", "x", "\u2028"])
NAME = st.lists(PIECES, min_size=1, max_size=6).map("".join)


@ROBOTS
@given(st.lists(NAME, min_size=5, max_size=5, unique=True))
def test_names_of_a_robot_are_never_code(words: list[str]) -> None:
    """Anybody may name a segment, and who writes its module then imports it."""
    name = f"test-stub-{os.getpid()}"
    with o80.Backend(
        name,
        words[:2],
        robot=words[2],
        extended={words[3]: IntEnum("Words", {words[4]: 1}), "place": float},
        requests={words[0]: {words[1]: float}},
        units={"place": words[2]},
    ) as backend:
        tree = ast.parse(module_of(backend.schema, name))
    called = {ast.unparse(each.func) for each in ast.walk(tree) if isinstance(each, ast.Call)}
    assert called == {"o80.Frontend", "o80.stub.check", "cast"}
