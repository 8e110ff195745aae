"""LeRobot's own motor bus as judge: on the fake servos it reads what the driver observes."""

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from fake_arm import JOINTS, FakeArm
from typer.testing import CliRunner

from o80_arms import cli

pytestmark = [
    pytest.mark.check,
    pytest.mark.parametrize("arm", ["so101", "koch"], indirect=True),
]

ROOT = Path(__file__).parents[3]


@pytest.fixture
def motors(monkeypatch: pytest.MonkeyPatch) -> Any:
    """LeRobot's package of motors."""
    packages = [*ROOT.glob("build/lerobot/lib/python3.*/site-packages")]
    if not packages:
        pytest.skip(
            f"there is no {ROOT}/build/lerobot: tools/setup.sh check installs LeRobot there"
        )
    monkeypatch.syspath_prepend(str(packages[0]))
    # the module imports torch, accelerate and datasets; the bus takes two functions for terminals
    terminal = ModuleType("lerobot.utils.utils")
    terminal.__dict__.update(enter_pressed=None, move_cursor_up=None)
    monkeypatch.setitem(sys.modules, terminal.__name__, terminal)
    return import_module("lerobot.motors")


@contextmanager
def connected(motors: Any, arm: FakeArm) -> Iterator[Any]:
    """LeRobot's bus as it has it for such an arm, with the calibration of the arm's file."""
    modes = motors.MotorNormMode
    mode = dict.fromkeys(JOINTS, modes.DEGREES) | {"gripper": modes.RANGE_0_100}
    if arm.kind == "koch":
        models = ["xl430-w250"] * 2 + ["xl330-m288"] * 4
        make = import_module("lerobot.motors.dynamixel").DynamixelMotorsBus
    else:
        models = ["sts3215"] * 6
        make = import_module("lerobot.motors.feetech").FeetechMotorsBus
    bus = make(
        port=str(arm.line.port),
        motors={
            joint: motors.Motor(number, models[number - 1], mode[joint])
            for number, joint in enumerate(JOINTS, 1)
        },
        calibration={
            joint: motors.MotorCalibration(**each)
            for joint, each in json.loads(arm.file.read_text()).items()
        },
    )
    # a busy machine may answer late
    bus.port_handler.isPacketTimeout = lambda: bus.port_handler.getTimeSinceStart() > 60_000
    bus.connect()
    yield bus
    bus.disconnect(disable_torque=False)
    arm.line.wait_until_closed()


def observed(arm: FakeArm) -> list[float]:
    """Positions that the driver observes, in LeRobot's units: degrees, and 0 to 100."""
    with arm.started() as robot:
        row = robot.latest()
        found = [*np.degrees(row.observed.joints), 100 * row.observed.gripper]
    arm.line.wait_until_closed()
    return found


def registers_of(arm: FakeArm, joint: str) -> dict[str, int]:
    """Registers that LeRobot sets when it connects."""
    if arm.kind == "koch":
        gains = {"Position_P_Gain": 1500, "Position_I_Gain": 0, "Position_D_Gain": 600}
        mode = {"Operating_Mode": 5 if joint == "gripper" else 4}
        return mode | (gains if joint == "elbow_flex" else {})
    gains = {"P_Coefficient": 16, "I_Coefficient": 0, "D_Coefficient": 32}
    return {"Operating_Mode": 0, **gains}


def assert_both_read_the_same(motors: Any, arm: FakeArm) -> None:
    before = arm.shown
    with connected(motors, arm) as bus:
        assert bus.is_calibrated
        of_lerobot = list(bus.sync_read("Present_Position").values())
    np.testing.assert_allclose(observed(arm), of_lerobot, rtol=0, atol=1e-12)
    assert arm.shown == before


def moving(arm: FakeArm, ends: dict[str, tuple[float, float]]) -> Callable[[], bool]:
    """A hand that moves the joints through their ranges, and then presses Enter."""
    path = [*np.linspace(0.5, 0, 30), *np.linspace(0, 1, 60), 0.5]

    def moved_on() -> bool:
        share = path.pop(0)
        for joint, (smallest, largest) in ends.items():
            arm.servo(joint).encoder = smallest + share * (largest - smallest)
        return not path

    moved_on()
    return moved_on


def test_lerobot_reads_what_the_driver_observes(motors: Any, arm: FakeArm) -> None:
    places = [2100] * 6, [800, 850, 3000, 870, 3900, 2001], [2048, 2049, 901, 3170, 61, 3450]
    for each in places:
        for servo, place in zip(arm.line.servos.values(), each, strict=True):
            servo.power_up()
            servo.stand_at(place)
        assert_both_read_the_same(motors, arm)


def test_the_driver_goes_on_where_lerobot_has_gone(motors: Any, arm: FakeArm) -> None:
    goals = dict(zip(JOINTS, (-40.0, 55.5, 30.2, -12.0, 90.0, 75.0), strict=True))
    with connected(motors, arm) as bus:
        with bus.torque_disabled():
            bus.configure_motors()
            for joint in JOINTS:
                for register, value in registers_of(arm, joint).items():
                    bus.write(register, joint, value)
        bus.sync_write("Goal_Position", goals)
        for _ in range(300):
            reached = bus.sync_read("Present_Position")
        for joint, goal in goals.items():
            assert reached[joint] == pytest.approx(goal, abs=0.1), joint  # a step is 0.09
    assert_both_read_the_same(motors, arm)


def test_the_driver_takes_a_calibration_that_lerobot_made(
    motors: Any, arm: FakeArm, monkeypatch: pytest.MonkeyPatch
) -> None:
    ends = {joint: (700.0 + 50 * i, 3000.0 + 100 * i) for i, joint in enumerate(JOINTS)}
    hand = moving(arm, ends)
    monkeypatch.setattr("lerobot.motors.motors_bus.enter_pressed", hand)
    with connected(motors, arm) as bus:
        bus.disable_torque()
        offsets = bus.set_half_turn_homings()
        assert set(bus.sync_read("Present_Position", normalize=False).values()) == {2047}
        smallest, largest = bus.record_ranges_of_motion(display_values=False)
        smallest["wrist_roll"], largest["wrist_roll"] = 0, 4095  # as it does
        made = {
            joint: motors.MotorCalibration(
                number, 0, offsets[joint], smallest[joint], largest[joint]
            )
            for number, joint in enumerate(JOINTS, 1)
        }
        bus.write_calibration(made)
    arm.file.write_text(json.dumps({joint: asdict(each) for joint, each in made.items()}))
    assert {each["homing_offset"] for each in json.loads(arm.file.read_text()).values()} != {0}
    assert_both_read_the_same(motors, arm)


def test_lerobot_takes_a_calibration_that_o80_made(
    motors: Any, arm: FakeArm, monkeypatch: pytest.MonkeyPatch
) -> None:
    # a busy machine; a Koch is asked in the other protocol first, and waited for
    monkeypatch.setattr("o80_arms.bus.WAIT", 3.0 if arm.kind == "koch" else 20.0)
    apart = 400 if arm.kind == "koch" else 500  # beyond a turn LeRobot misreads a Koch's gripper
    ends = {joint: (1.0 * apart * i, apart * i + 2300.0) for i, joint in enumerate(JOINTS, 1)}
    monkeypatch.setattr(cli, "pressed_enter", moving(arm, ends))
    arm.file.unlink()
    words = ["calibrate", "--port", str(arm.line.port), "--name", str(arm.file)]
    done = CliRunner().invoke(cli.app, words)
    assert done.exit_code == 0, done.output
    arm.line.wait_until_closed()
    for joint, (smallest, largest) in ends.items():
        arm.servo(joint).encoder = smallest + 0.3 * (largest - smallest)
    assert_both_read_the_same(motors, arm)
