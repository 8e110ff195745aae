"""The contract that LeRobot asks of a robot and a teleoperator, kept by those of o80."""

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from lerobot.cameras import Camera, CameraConfig
from lerobot.robots import make_robot_from_config
from lerobot.teleoperators import make_teleoperator_from_config
from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError
from starting import Start

import o80
from lerobot_robot_o80 import O80, O80Config, O80TeleopConfig

pytestmark = pytest.mark.check

JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
NAMES = [f"{joint}.pos" for joint in JOINTS]
Make = Callable[..., O80]


@pytest.fixture
def make(tmp_path: Path) -> Iterator[Make]:
    """Makes a robot of LeRobot for a segment."""
    made: list[O80] = []

    def make(segment: str, **options: Any) -> O80:
        config = O80Config(
            segment=segment, calibration_dir=tmp_path, **{"timeout": 60.0, **options}
        )
        made.append(make_robot_from_config(config))
        return made[-1]

    yield make
    for robot in made:
        if robot.is_connected:
            robot.disconnect()


@pytest.fixture
def two(start: Start) -> str:
    return start("two_joints", frequency=200)


def settle(segment: str, places: dict[int, float]) -> o80.Observation:
    """Waits until these joints are desired there."""
    with o80.Frontend(segment, read_only=True) as arm:
        row = arm.latest()
        while any(abs(row.desired[joint] - place) > 1e-9 for joint, place in places.items()):
            row = arm.wait_for(row.iteration + 1, 60.0)
        return row


def test_its_features_are_known_before_it_is_connected(make: Make, start: Start) -> None:
    robot = make(start("so101"))
    assert robot.action_features == dict.fromkeys(NAMES, float)
    assert [*robot.observation_features] == NAMES
    assert not robot.is_connected
    with pytest.raises(DeviceNotConnectedError):
        robot.get_observation()
    with pytest.raises(DeviceNotConnectedError):
        robot.send_action({})
    with pytest.raises(o80.InvalidArgument, match="units must be one of"):
        make(robot.config.segment, units="radians").connect()


def test_connect_takes_control_and_moves_nothing(make: Make, two: str) -> None:
    robot = make(two)
    with o80.Frontend(two) as other:
        robot.connect()
        with pytest.raises(DeviceAlreadyConnectedError):
            robot.connect()
        other.add_command("elbow", 0.5)
        with pytest.raises(o80.NotCompleted, match="control"):
            other.pulse_and_wait(timeout=60.0)
        assert not other.history().active.any()
        assert robot.get_observation() == {"shoulder.pos": 0.0, "elbow.pos": 0.0}
        robot.disconnect()
        other.add_command("elbow", 0.5)
        assert other.pulse_and_wait(timeout=60.0).desired[1] == 0.5
        with other.control(), pytest.raises(o80.ControlTaken):
            make(two, timeout=0.1).connect()


def test_what_is_sent_is_clipped_and_written_into_the_action(make: Make, two: str) -> None:
    robot = make(two)
    robot.connect()
    action = {"elbow.pos": torch.tensor(0.25), "shoulder.pos": 7.0}
    assert robot.send_action(action) is action
    assert action == {"elbow.pos": 0.25, "shoulder.pos": 3.0}
    settle(two, {0: 3.0, 1: 0.25})
    robot.send_action({"elbow.pos": np.float32(0.5)})  # some of the joints
    settle(two, {0: 3.0, 1: 0.5})
    with o80.Frontend(two, read_only=True) as arm:
        sent = [each.seen for each in arm.journal() if each.kind == "taken" and each.seen]
    assert sent  # each says by which row it was decided


@pytest.mark.parametrize(
    ("action", "why"),
    [
        ({"elbow.pos": math.nan}, "'elbow.pos' must be a finite number"),
        ({"elbow": 0.1}, r"no 'elbow'. Did you mean 'elbow.pos'"),
    ],
)
def test_an_action_that_cannot_be_sent_is_refused_as_a_whole(
    make: Make, two: str, action: dict[str, float], why: str
) -> None:
    robot = make(two)
    robot.connect()
    with pytest.raises(o80.InvalidArgument, match=why):
        robot.send_action({"shoulder.pos": 0.5, **action})
    robot.send_action({"elbow.pos": 0.1})
    assert settle(two, {1: 0.1}).desired[0] == 0.0


def test_units_are_those_of_lerobots_driver_or_the_chosen_ones(make: Make, start: Start) -> None:
    segment = start("so101", moved=100)
    with o80.Frontend(segment, read_only=True) as arm:
        row = arm.latest()
    degrees, normalised, native = (
        make(segment, units=units) for units in ("", "normalised", "native")
    )
    numbers = {}
    for robot in (degrees, normalised, native):
        robot.connect()
        numbers[robot.config.units] = [*robot.get_observation().values()]
        robot.disconnect()
    assert numbers["native"] == pytest.approx([*row.observed.joints, row.observed.gripper])
    joints = np.degrees(row.observed.joints)
    assert numbers[""] == pytest.approx([*joints, 100 * row.observed.gripper])
    # LeRobot's: shares of the calibrated range, which the limits of three joints cut
    ranges = np.array([2505, 2275, 2207, 2161, 3639])
    assert numbers["normalised"][:5] == pytest.approx(200 * joints / (ranges * 360 / 4095))
    with pytest.raises(o80.InvalidArgument, match="has no calibrated ranges"):
        make(start("so101_twin"), units="normalised").connect()


def test_a_halt_is_an_error_with_its_text(make: Make, two: str) -> None:
    robot = make(two)
    robot.connect()
    with o80.Frontend(two) as arm:
        arm.halt("a hand in the way")
        for call in (robot.get_observation, lambda: robot.send_action({"elbow.pos": 0.1})):
            with pytest.raises(o80.BackendHalted, match=r"a hand in the way.*o80 resume"):
                call()
        arm.resume(timeout=60.0)
        robot.get_observation()


def test_the_end_of_its_process_and_a_hang_are_errors(make: Make, tmp_path: Path) -> None:
    segment = f"test-{tmp_path.name}"
    with o80.robots.load("two_joints").start(segment, gap=0):
        robot = make(segment)
        robot.connect()
        robot.segment._timeout = -1.0  # any row is too old
        with pytest.raises(o80.TimeoutError, match="has had no row"):
            robot.get_observation()
        robot.segment._timeout = 60.0
    with pytest.raises(o80.BackendGone):
        robot.get_observation()
    robot.disconnect()


@pytest.mark.parametrize("at_stop", ["hold", "relax", "rest"])
def test_disconnect_leaves_the_arm_as_at_stop_says(make: Make, start: Start, at_stop: str) -> None:
    robot = make(start("so101_twin"), at_stop=at_stop)
    robot.connect()
    stood = robot.get_observation()["wrist_roll.pos"]
    robot.send_action({"wrist_roll.pos": stood + 20})
    with o80.Frontend(robot.config.segment, read_only=True) as arm:
        row = arm.latest()
        while abs(np.degrees(row.desired.joints[4]) - stood - 20) > 1e-6:
            row = arm.wait_for(row.iteration + 1, 60.0)
        robot.disconnect()
        asked = [
            command.request
            for entry in arm.journal()
            for command in entry.commands
            if command.kind == "request"
        ]
        assert asked == ([] if at_stop == "hold" else ["relax"])
        place = np.degrees(arm.history().desired.joints[:, 4])
        if at_stop == "rest":
            assert np.abs(place - stood)[row.iteration - arm.oldest :].min() < 0.5
            assert np.abs(np.diff(place[row.iteration - arm.oldest :])).max() < 0.5
        else:
            assert abs(place[-1] - stood) > 15


def test_a_halted_arm_is_left_as_it_is(make: Make, start: Start) -> None:
    robot = make(start("so101_twin"), at_stop="rest")
    robot.connect()
    with o80.Frontend(robot.config.segment) as arm:
        arm.halt("stop")
        robot.disconnect()
        assert arm.halted is not None
        assert not [each for entry in arm.journal() for each in entry.commands if each.request]


def test_what_cannot_work_is_refused_when_it_connects(make: Make, two: str, start: Start) -> None:
    with pytest.raises(o80.InvalidArgument, match="at_stop=hold"):
        make(two, at_stop="relax").connect()
    with pytest.raises(o80.TimeoutError, match="nobody-at-all"):
        make("nobody-at-all", timeout=0.0).connect()
    with pytest.raises(ValueError, match="hold, relax, rest"):
        make(two, at_stop="fall")
    bursting = start("two_joints", bursting=True)
    with pytest.raises(o80.InvalidArgument, match="real time"):
        make(bursting).connect()


@CameraConfig.register_subclass("grey_of_test")
class GreyConfig(CameraConfig):
    """A camera whose images are grey."""


class Grey(Camera):
    def __init__(self, config: GreyConfig) -> None:
        super().__init__(config)
        self.is_open = False

    is_connected = property(lambda self: self.is_open)

    @staticmethod
    def find_cameras() -> list[dict[str, Any]]:
        return []

    def connect(self, warmup: bool = True) -> None:
        self.is_open = True

    def read(self, color_mode: Any = None) -> Any:
        return np.full((self.height, self.width, 3), 127, np.uint8)

    def async_read(self, timeout_ms: float = 200) -> Any:
        return self.read()

    def read_latest(self, max_age_ms: int = 500) -> Any:
        return self.read()

    def disconnect(self) -> None:
        self.is_open = False


def test_it_reads_cameras_of_lerobot_beside_the_robot(
    make: Make, two: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    grey = Grey(GreyConfig(fps=30, width=8, height=6))
    monkeypatch.setattr(
        "lerobot_robot_o80.robot.make_cameras_from_configs", lambda configs: {"top": grey}
    )
    robot = make(two, cameras={"top": GreyConfig(fps=30, width=8, height=6)})
    assert robot.observation_features["top"] == (6, 8, 3)
    robot.connect()
    assert robot.get_observation()["top"].shape == (6, 8, 3)
    robot.disconnect()
    assert not grey.is_connected


def test_a_leader_gives_actions_and_is_not_commanded(leader: str, tmp_path: Path) -> None:
    config = O80TeleopConfig(segment=leader, calibration_dir=tmp_path, timeout=60.0)
    teleop = make_teleoperator_from_config(config)
    assert teleop.action_features == dict.fromkeys(NAMES, float)
    assert teleop.feedback_features == {}
    with pytest.raises(DeviceNotConnectedError):
        teleop.get_action()
    teleop.connect()
    assert [*teleop.get_action().values()][:5] == pytest.approx([200 * 360 / 4095] * 5, abs=0.1)
    with o80.Frontend(leader, read_only=True) as arm:
        assert not arm.history().active.any()
    teleop.disconnect()
