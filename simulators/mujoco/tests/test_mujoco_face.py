"""A model whose joints are driven by its actuators, and the face of another robot that it takes."""

import base64
import json
import os
import random
from enum import IntEnum
from functools import reduce
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

import o80
from o80.datasets.export import write
from o80.drivers import Desired, Reading
from o80.robots.robot import face_text
from o80.testing import check_robot
from o80.view.scene import Scene
from o80.view.world import drawn

MODELS = Path(__file__).parent / "models"
TWO_JOINTS = MODELS / "two_joints.xml"
SIMULATION = o80.robots.load("mujoco")

LIMITS = o80.Limits(minimum=-1.7, maximum=1.7, speed=2.5, acceleration=20, jerk=1000, error=0.35)


class Health(IntEnum):
    OK = 0
    HEAT = 4


class Gripping:
    """An arm with a gripper, which is where it is asked to be."""

    actuators: ClassVar[dict[str, Any]] = {"joints": (float, ["pan", "lift"]), "gripper": float}
    units: ClassVar[dict[str, Any]] = {
        "joints.": "rad",
        "gripper.": "1",
        "velocity": "rad/s",
        "temperature": "C",
    }
    limits: ClassVar[dict[str, Any]] = {
        "pan": LIMITS,
        "lift": o80.Limits(minimum=-1, maximum=1.2, speed=1, acceleration=5, jerk=100),
        "gripper": o80.Limits(minimum=0, maximum=1, speed=3, acceleration=30),
    }
    extended: ClassVar[dict[str, Any]] = {
        "measured": {"velocity": (float, 3), "temperature": (float, 3)},
        "health": Health,
        "link": {"capture_time": np.int64, "fresh": bool},
    }
    requests: ClassVar[dict[str, Any]] = {"strength": {"share": float}, "relax": {}}

    def __init__(self) -> None:
        self.there = np.zeros(3)

    def write(self, desired: Desired) -> None:
        self.there = np.append(desired.states.joints, desired.states.gripper)

    def read(self, reading: Reading) -> None:
        reading.observed["joints"] = self.there[:2]
        reading.observed["gripper"] = self.there[2]

    def on_strength(self, fields: o80.Record) -> None:
        pass

    on_relax = on_strength


GRIPPING = """
<mujoco>
  <option timestep="0.002" gravity="0 0 0" integrator="implicitfast"/>
  <default><joint damping="0.1"/><geom type="capsule" size="0.02" mass="0.2"/></default>
  <worldbody>
    <body><joint name="pan" axis="0 0 1" range="-110 110"/><geom fromto="0 0 0 0.1 0 0"/>
      <body pos="0.1 0 0"><joint name="j2" axis="0 1 0" range="-90 90"/>
        <geom fromto="0 0 0 0.2 0 0"/>
        <body pos="0.2 0 0"><joint name="jaw" axis="0 1 0" range="0 100"/>
          <geom fromto="0 0 0 0.05 0 0" mass="0.05"/></body></body></body>
  </worldbody>
  <actuator>
    <position name="pan" joint="pan" kp="20" kv="1" inheritrange="1"/>
    <position name="lift" joint="j2" kp="20" kv="1" inheritrange="1"/>
    <position name="gripper" joint="jaw" kp="5" kv="0.2" inheritrange="1"/>
  </actuator>
</mujoco>
"""


@pytest.fixture
def gripping(tmp_path: Path) -> Path:
    model = tmp_path / "gripping.xml"
    model.write_text(GRIPPING)
    return model


def last_angle(robot: o80.Frontend, row: Any) -> float:
    """The angle [rad] of the last joint of a chain, as viewers draw it."""
    what = drawn(robot.schema, robot.model, trusted=False)
    assert what is not None
    before, last = Scene(robot.schema, what).observed(bytes(row))[-2:, 3:]
    return float(2 * np.arccos(abs(before @ last)))


def written(folder: Path, actuators: str, joint: str = "") -> Path:
    """A model with one joint and these actuators."""
    model = folder / "one.xml"
    model.write_text(
        f"""<mujoco><option gravity="0 0 0"/><actuator>{actuators}</actuator>
        <worldbody><body><joint name="x" {joint}/><geom size="0.1"/></body></worldbody></mujoco>"""
    )
    return model


# ---------------------------------------------------------------- mode=actuated


def test_joints_with_actuators_are_the_actuators_of_the_robot() -> None:
    with SIMULATION.inline(
        model=TWO_JOINTS, mode="actuated", limits="2.5 20 1000 0.4, elbow=2 15"
    ) as arm:
        shoulder, elbow = arm.actuators
        assert (shoulder.name, shoulder.group, shoulder.numbers[0].unit) == (
            "shoulder",
            "joints",
            "rad",
        )
        assert shoulder.limits == o80.Limits(
            minimum=-np.pi, maximum=np.pi, speed=2.5, acceleration=20, jerk=1000, error=0.4
        )
        assert (elbow.limits.speed, elbow.limits.acceleration, elbow.limits.jerk) == (2, 15, 1000)
        arm.add_command(None, [0.8, -0.5], duration=1)
        row = arm.pulse_and_wait()
        np.testing.assert_allclose(row.desired.joints, [0.8, -0.5])
        np.testing.assert_allclose(row.observed.joints, [0.8, -0.5], atol=0.1)
        np.testing.assert_array_equal(row.observed.joints, row.extended.joints["position"])
        fields = arm.schema["extended"]["fields"]
        (joints,) = (each for each in fields if each["name"] == "joints")
        assert [each["unit"] for each in joints["type"]["fields"]] == ["rad", "rad/s"]


@pytest.mark.parametrize(
    ("actuator", "joint", "group", "units", "bounds"),
    [
        ('<position joint="x" kp="9" ctrlrange="-4 1" gear="2"/>', 'type="slide" range="-1 1"',
         "slides", ["m"], (-1, 0.5)),
        ('<velocity joint="x" kv="2" ctrlrange="-3 3"/>', 'range="-1 1"',
         "velocity_joints", ["rad/s", "rad"], (-3, 3)),
        ('<intvelocity joint="x" kp="20" kv="1" actrange="-2 2" ctrlrange="-1 1"/>', "",
         "velocity_joints", ["rad/s", "rad"], (-1, 1)),
        ('<motor joint="x" gear="5" ctrlrange="-1 1"/>', "", "torque_joints", ["Nm", "rad"],
         (-5, 5)),
        ('<motor joint="x"/>', 'type="slide"', "force_slides", ["N", "m"], (-np.inf, np.inf)),
    ],
)  # fmt: skip
def test_an_actuator_says_what_its_joint_takes(
    actuator: str, joint: str, group: str, units: list[str], bounds: Any, tmp_path: Path
) -> None:
    model = written(tmp_path, actuator, f'{joint} damping="1"')
    model.write_text(model.read_text().replace("<mujoco>", '<mujoco><compiler angle="radian"/>'))
    with SIMULATION.inline(model=model, mode="actuated") as arm:
        (one,) = arm.actuators
        assert (one.name, one.group, [each.unit for each in one.numbers]) == ("x", group, units)
        assert one.limits.numbers()[:2] == pytest.approx(bounds)
        for number in one.numbers[:-1]:
            assert number.rest == 0
        arm.add_command("x", 0.4, duration=0.2)
        row = arm.pulse_and_wait()
        assert row.desired[group].view(float)[0] == 0.4
        assert row.observed[group].view(float)[-1] > 1e-4  # [rad] or [m]


def test_a_velocity_brakes_before_the_range_of_its_joint_ends(tmp_path: Path) -> None:
    model = written(tmp_path, '<velocity joint="x" kv="2"/>', 'range="-30 30"')
    with SIMULATION.inline(model=model, mode="actuated", limits="10 100") as arm:
        bounds = arm.actuators[0].limits.integral
        assert bounds == o80.IntegralBounds("position", -np.pi / 6, np.pi / 6)
        arm.add_command("x", 1.5)
        arm.burst(1000)
        (at,) = arm.latest().observed.velocity_joints["position"]
        assert np.pi / 6 - 0.05 < at < np.pi / 6 + 0.01
        assert arm.latest().desired.velocity_joints["velocity"][0] == 0


URDF = """<?xml version="1.0"?>
<robot name="arm">
  <!-- <joint name="elbow"><limit velocity="9"/></joint> -->
  <mujoco><compiler discardvisual="true"/></mujoco>
  <link name="base"/>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <limit lower="-1.5" upper="2" effort="30" velocity = '2.5' />
  </joint>
  <joint name="elbow" type="revolute">
    <parent link="upper"/><child link="lower"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="2.6" effort="0" velocity="0"/>
  </joint>
  <joint name="wrist" type="revolute">
    <parent link="lower"/><child link="hand"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="5" velocity="3"/>
  </joint>
  {links}
</robot>"""
LINK = """<link name="{}"><inertial><mass value="1"/>
  <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
DRIVES = """<mujoco><actuator>
  <position name="shoulder" joint="shoulder" kp="9" kv="1" inheritrange="1"/>
  <position name="elbow" joint="elbow" kp="9" kv="1" inheritrange="1"/>
  <velocity name="wrist" joint="wrist" kv="1" ctrlrange="-2 20"/>
</actuator></mujoco>"""


def urdf_arm(folder: Path, urdf: str = URDF, **options: Any) -> Any:
    """An arm of three joints from a URDF file, and its drives."""
    model, things = folder / "arm.urdf", folder / "drives.xml"
    model.write_text(urdf.replace("{links}", "".join(map(LINK.format, ("upper", "lower", "hand")))))
    things.write_text(DRIVES)
    return SIMULATION.inline(model=model, things=things, mode="actuated", **options)


@pytest.mark.parametrize(
    ("limits", "speeds"),
    [("", [2.5, np.inf]), ("1 20, elbow=4", [1, 4]), ("shoulder=1", [1, np.inf])],
)
def test_a_urdf_file_has_the_limits_that_are_not_given(
    limits: str, speeds: list[float], tmp_path: Path
) -> None:
    with urdf_arm(tmp_path, limits=limits) as arm:
        shoulder, elbow, wrist = arm.actuators
        assert [shoulder.limits.speed, elbow.limits.speed] == speeds
        assert shoulder.limits.numbers()[:2] == (-1.5, 2)
        assert wrist.limits.numbers()[:2] == (-2, 3)  # a velocity, by its drive and the file


def test_a_joint_of_urdf_keeps_its_limits_under_another_name(tmp_path: Path) -> None:
    with urdf_arm(tmp_path, joints="first=shoulder") as arm:
        assert [(each.name, each.limits.speed) for each in arm.actuators] == [("first", 2.5)]


@pytest.mark.parametrize("velocity", ["fast", "-1", "1 2"])
def test_a_speed_of_urdf_that_is_no_number_is_refused(velocity: str, tmp_path: Path) -> None:
    with pytest.raises(o80.DriverError, match=f"velocity of joint 'wrist' .* got '{velocity}'"):
        urdf_arm(tmp_path, URDF.replace('velocity="3"', f'velocity="{velocity}"'))


def test_joints_can_be_chosen_and_renamed() -> None:
    with SIMULATION.inline(model=TWO_JOINTS, mode="actuated", joints="last=elbow") as arm:
        assert [each.name for each in arm.actuators] == ["last"]
        arm.add_command("last", 0.5)
        assert arm.burst(500).extended.joints["position"][1] == pytest.approx(0.5, abs=0.1)


def test_driven_joints_keep_what_o80_builds_on() -> None:
    limited = {"model": TWO_JOINTS, "mode": "actuated", "limits": "2.5 20 1000"}
    assert check_robot("mujoco", limited) == []


def test_a_reset_and_a_resume_begin_where_the_joints_are() -> None:
    with SIMULATION.inline(model=TWO_JOINTS, mode="actuated") as arm:
        arm.add_command("shoulder", 1.0, duration=0.1)
        arm.burst(50)
        arm.request("snapshot", slot=1)
        kept = arm.latest()
        arm.burst(50)
        arm.resume(arm.halt("a test"))
        row = arm.latest()
        np.testing.assert_array_equal(row.desired.joints, row.observed.joints)
        arm.request("restore", slot=1)
        np.testing.assert_array_equal(arm.latest().desired.joints, kept.desired.joints)
        arm.request("reset")
        assert arm.latest().desired.joints.tolist() == [0, 0]


# ---------------------------------------------------------------- like


def face_file(face: dict[str, Any], folder: Path) -> Path:
    path = folder / "face.json"
    path.write_text(json.dumps(face))
    return path


def test_a_model_takes_the_face_of_a_robot_however_it_is_named(tmp_path: Path) -> None:
    robot = o80.robots.load("two_joints")
    with robot.inline(f"face-{os.getpid()}", reach=2.5, frequency=400) as real:
        with o80.Recording(tmp_path / "run.mcap", [real]):
            real.burst(10)
        face = o80.face(real)
        recording = o80.open(tmp_path / "run.mcap")
        for named in (
            real,
            real.segment,
            tmp_path / "run.mcap",
            f"{tmp_path / 'run.mcap'}:{real.segment}",
            recording,
            recording[real.segment],
            face_file(real.schema, tmp_path),
        ):
            with SIMULATION.inline(model=TWO_JOINTS, like=named) as twin:
                assert o80.face(twin) == face
                assert twin.schema["period"] == 2_500_000
                assert twin.schema["robot"] == "mujoco"
    with SIMULATION.inline(model=TWO_JOINTS, like=face_file(face, tmp_path)) as twin:
        assert o80.face(twin) == face
    for installed in ("two_joints", robot):
        assert o80.face(installed)["actuators"][0]["limits"][0]["maximum"] == 3
        described = SIMULATION.describe(model=TWO_JOINTS, like=installed)
        assert o80.face(described) == o80.face(robot)
        assert described["period"] == 1_000_000  # of a robot that has no rate of its own


def test_the_model_serves_what_it_has_and_marks_the_rest(gripping: Path) -> None:
    with (
        o80.robots.load(Gripping).inline(frequency=150) as real,
        SIMULATION.inline(model=gripping, like=real, joints="lift=j2") as twin,
    ):
        assert o80.face(twin) == o80.face(real)
        twin.add_command(None, [0.5, 0.3, 0.5], duration=0.5)
        row = twin.pulse_and_wait()
        assert row.observed.gripper == pytest.approx(0.5, abs=0.1)  # of the range of its joint
        turned = np.radians(100 * row.observed.gripper)
        assert last_angle(twin, row) == pytest.approx(turned)
        seen = row.extended
        assert np.isfinite(seen.measured.velocity).all()
        assert np.isnan(seen.measured.temperature).all()
        assert seen.health == "OK"
        assert seen.link.fresh
        assert seen.link.capture_time == row.time
        measured = twin.schema["extended"]["fields"][0]["type"]["fields"]
        assert [field.get("origin") for field in measured] == [None, "absent"]
        with pytest.raises(o80.RequestRejected, match="only describes the request"):
            twin.request("strength", share=0.5)
        (run,) = o80.replay(twin)
        assert run.identical, run


def test_the_steps_of_the_engine_fill_the_period(gripping: Path) -> None:
    options: dict[str, Any] = {"model": gripping, "frequency": 150}
    with (
        SIMULATION.inline(**options, like=Gripping, joints="lift=j2") as twin,
        SIMULATION.inline(
            **options, timestep=1 / 600, mode="actuated", joints="pan, lift=j2, gripper"
        ) as other,
    ):  # 2 ms does not divide 6.7 ms: four steps of a 600th of a second
        twin.add_command(None, [0.5, 0.3, 0.5], iterations=20)
        twin.pulse_and_wait()
        rows = twin.history(since=1)
        for i, (pan, lift) in enumerate(rows.desired.joints):
            jaw = rows.desired.gripper[i] * np.deg2rad(100)
            other.add_command(None, [pan, lift, jaw])
            joints = other.burst(1).observed.joints[:2]
            np.testing.assert_allclose(joints, rows.observed.joints[i], rtol=1e-6)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"model": TWO_JOINTS}, "no joint 'pan'"),
        ({"joints": "lift=j3"}, "no joint 'j3'"),
        ({"joints": "lft=j2"}, "no actuator 'lft'; there are: pan"),
        ({"joints": "lift=j2 1"}, "the two numbers at the ends"),
        ({"limits": "1"}, "leave out limits"),
        ({"mode": "control"}, "leave out mode=control"),
        ({"balls": "x"}, "leave out balls"),
        ({"like": "no.json"}, "holds no description"),
        ({"like": "nobody_has_it"}, "no robot 'nobody_has_it'"),
    ],
)
def test_what_does_not_fit_is_refused(options: dict[str, Any], text: str, gripping: Path) -> None:
    with pytest.raises((o80.DriverError, o80.InvalidArgument), match=text):
        SIMULATION.describe(**{"model": gripping, "like": Gripping, "joints": "lift=j2", **options})


def face_of(table: bytes | bytearray, start: int = 0xCBF29CE484222325) -> str:
    """The text of a face with this table and its hash (FNV-1a)."""
    value = reduce(lambda value, byte: (value ^ byte) * 0x100000001B3 % 2**64, table, start)
    return f"face:{base64.b64encode(value.to_bytes(8, 'little') + table).decode()}"


def test_a_damaged_face_is_refused_and_never_crashes(gripping: Path) -> None:
    """A stranger's recording may have such an option, which a replay gives to the driver."""
    text = face_text(Gripping)
    good = base64.b64decode(text[5:])[8:]
    assert face_of(good) == text
    choose = random.Random(4)
    for damaged in (text[:-9], text.replace("A", "B", 1), f"{text[:100]}%{text[101:]}", "face:"):
        with pytest.raises(o80.InvalidArgument, match="the text of the face is damaged"):
            SIMULATION.describe(model=gripping, joints="lift=j2", like=damaged)
    refused = 0
    for _ in range(1500):  # tables that somebody has changed with care
        table = bytearray(good)
        for at in choose.sample(range(0, len(table), 4), choose.randrange(1, 4)):
            number = choose.choice([0, 1, 65535, 2**31, 2**32 - 1, choose.randrange(2**32)])
            table[at : at + 4] = number.to_bytes(4, "little")
        try:
            SIMULATION.describe(model=gripping, joints="lift=j2", like=face_of(table))
        except (o80.DriverError, o80.InvalidArgument):
            refused += 1
    assert refused > 500


@pytest.mark.parametrize("period", [1, -5, 10**18])
def test_a_face_with_a_period_that_no_loop_has_is_refused(gripping: Path, period: int) -> None:
    face = {**o80.robots.load(Gripping).describe(), "period": period}
    with pytest.raises(o80.InvalidArgument, match="the period of the face must be from 1000"):
        SIMULATION.describe(model=gripping, joints="lift=j2", like=face_text(face))


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        ("[" * 100_000, "holds no description"),
        ('{"groups": [{"count": 1e400}]}', "not complete"),
        ('{"groups": [{"name": "a", "count": 1, "array": 0, "type": {"name": "", "size": 8, '
         '"fields": [{"name": "", "kind": {}, "size": 8, "shape": []}]}}]}', "wrong type"),
        ('{"groups": [{"name": "a", "count": 1, "array": 0, "type": {"name": "", "size": 0, '
         '"fields": [{"name": "", "kind": "enum", "size": 0, "shape": []}]}}]}', "not complete"),
    ],
)  # fmt: skip
def test_a_broken_file_of_a_face_is_refused_in_words(tmp_path: Path, wrong: str, why: str) -> None:
    file = tmp_path / "face.json"
    file.write_text(wrong)
    with pytest.raises(o80.InvalidArgument, match=why) as refused:
        face_text(str(file))
    assert len(str(refused.value)) < 500


def test_a_recording_without_the_segment_says_which_it_has(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    with SIMULATION.inline(model=TWO_JOINTS) as arm, o80.Recording(path, arm):
        arm.burst(2)
        name = arm.segment
    with pytest.raises(o80.InvalidArgument, match=f"has no segment 'nope', it has: {name}"):
        o80.face(f"{path}:nope")


def test_a_model_that_allows_less_is_refused(tmp_path: Path) -> None:
    model = tmp_path / "narrow.xml"
    narrow = 'name="elbow" range="-90 90"/>'
    model.write_text(TWO_JOINTS.read_text().replace('name="elbow"/>', narrow))
    with pytest.raises(o80.DriverError, match=r"'elbow' is allowed .* only from -1\.5708 to"):
        SIMULATION.describe(model=model, like="two_joints")


def test_a_robot_without_bounds_gets_those_of_the_model(tmp_path: Path) -> None:
    face = o80.face("two_joints")
    for actuator in face["actuators"]:
        actuator["limits"][0].update(minimum=None, maximum=None)
    described = SIMULATION.describe(model=TWO_JOINTS, like=face_file(face, tmp_path))
    assert described["actuators"][1]["limits"][0]["maximum"] == pytest.approx(np.pi)


class Script:
    """Random commands, the same for the same seed; they depend on nothing that is observed."""

    def __init__(self, arm: o80.Frontend, seed: int) -> None:
        self._arm = arm
        self._random = random.Random(seed)

    def play(self) -> None:
        for _ in range(self._random.randrange(2, 7)):
            getattr(self, self._random.choice(["command", "batch", "chunk", "purge"]))()
            self._arm.burst(self._random.randrange(1, 40))

    def target(self, index: int) -> float:
        limits = self._arm.actuators[index].limits
        return self._random.uniform(limits.minimum, limits.maximum)

    def pace(self, index: int) -> dict[str, Any]:
        paces: list[dict[str, Any]] = [
            {},
            {"duration": self._random.uniform(0.001, 0.3)},
            {"iterations": self._random.randrange(1, 60)},
            {"speed": self._random.uniform(0.1, 1)},
            {"until": self._arm.published + self._random.randrange(60, 200)},
            {"every": self._random.randrange(2, 20) / 150},
        ]
        if np.isfinite(self._arm.actuators[index].limits.acceleration):
            paces.append({"fastest": True})
        return self._random.choice(paces)

    def command(self) -> None:
        for _ in range(self._random.randrange(1, 4)):
            index = self._random.randrange(len(self._arm.actuators))
            mode = self._random.choice([o80.Mode.QUEUE, o80.Mode.OVERWRITE])
            self._arm.add_command(index, self.target(index), mode=mode, **self.pace(index))

    def batch(self) -> None:
        targets = [self.target(index) for index in range(len(self._arm.actuators))]
        self._arm.add_command(None, targets, **self.pace(0))
        self.command()

    def chunk(self) -> None:
        rows = [[self.target(0), self.target(1)] for _ in range(5)]
        with self._arm.chunks([0, 1], step=self._random.randrange(1, 12)) as plan:
            plan.send(rows, seen=self._arm.latest())
            self._arm.burst(self._random.randrange(1, 60))

    def purge(self) -> None:
        self._arm.purge()


@pytest.mark.parametrize("robot", ["two_joints", Gripping])
def test_scripts_give_the_same_desired_rows_on_a_robot_and_on_its_twin(
    robot: Any, gripping: Path
) -> None:
    model: dict[str, Any] = {"model": TWO_JOINTS}
    if robot is Gripping:
        model = {"model": gripping, "joints": "lift=j2"}
    small: dict[str, Any] = {"history": 800, "lanes": 1, "lane_blocks": 256, "journal": 0}
    moved = 0
    for seed in range(300):
        with (
            o80.robots.load(robot).inline(frequency=150, **small) as real,
            SIMULATION.inline(**model, like=real, slots=0, **small) as twin,
        ):
            Script(real, seed).play()
            Script(twin, seed).play()
            rows, others = real.history().rows, twin.history().rows
            for part in ("desired", "active", "clamped", "braking", "starved"):
                assert rows[part].tobytes() == others[part].tobytes(), (seed, part)
            moved += any(rows["desired"].tobytes())
    assert moved > 200


def test_one_script_one_policy_and_one_export_run_on_both(gripping: Path, tmp_path: Path) -> None:
    goal = np.array([0.6, -0.4])
    files: list[Path] = []
    with (
        o80.robots.load(Gripping).inline(frequency=150) as real,
        SIMULATION.inline(model=gripping, like=real, joints="lift=j2") as twin,
    ):
        for arm in (real, twin):
            arm.move_to(["pan", "lift"], [0.3, 0.2], duration=0.5, tolerance=0.1)
            with arm.chunks(["pan", "lift"], step=5) as plan:
                for _ in range(30):  # it answers with five steps of a tenth of the way that is left
                    seen = plan.wait(lead=10)
                    way = goal - seen.observed.joints
                    plan.send([seen.observed.joints + 0.1 * j * way for j in range(1, 6)])
            arm.burst(200)
            np.testing.assert_allclose(arm.latest().observed.joints, goal, atol=0.1)
            files.append(tmp_path / f"{len(files)}.npz")
            write(files[-1], {"arm": arm.history()})
    with np.load(files[0]) as one, np.load(files[1]) as other:
        assert [*one] == [*other]
        assert all(one[name].dtype == other[name].dtype for name in one)


def test_numbers_are_spread_over_the_range_of_a_joint(gripping: Path) -> None:
    degrees: Any = json.loads(json.dumps(o80.face(Gripping)))
    degrees["groups"][0]["type"]["fields"][0]["unit"] = "deg"
    for actuator in degrees["actuators"][:2]:
        actuator["limits"][0].update(minimum=-90, maximum=90, error=None)
    table = "pan=pan -110 110, lift=j2 -90 90, gripper=jaw 1 0"
    with pytest.raises(o80.DriverError, match="'pan' is in deg, joint 'pan' in rad"):
        SIMULATION.describe(model=gripping, like=degrees, joints="lift=j2")
    with SIMULATION.inline(model=gripping, like=degrees, joints=table, frequency=500) as twin:
        assert twin.latest().observed.gripper == 1  # shut at 1: the lower end of its joint
        twin.add_command(None, [30, 20, 0.5], duration=1)
        twin.pulse_and_wait(check=False)
        row = twin.burst(500)
        np.testing.assert_allclose(row.observed.joints, [30, 20], atol=0.5)
        assert row.observed.gripper == pytest.approx(0.5, abs=0.01)
        np.testing.assert_allclose(row.extended.measured.velocity, 0, atol=0.01)


def test_a_twin_keeps_what_o80_builds_on(gripping: Path) -> None:
    like = {"like": Gripping, "model": gripping, "joints": "lift=j2"}
    assert check_robot("mujoco", like) == []


def test_a_process_takes_the_face_too(gripping: Path) -> None:
    options: dict[str, Any] = {"model": gripping, "joints": "lift=j2", "bursting": True}
    name = f"face-process-{os.getpid()}"
    with SIMULATION.start(name, like=Gripping, **options) as robot, robot.frontend() as twin:
        assert o80.face(twin) == o80.face(Gripping)
