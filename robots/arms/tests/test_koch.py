"""A Koch arm's own: settings that torque locks, restarts, and a watchdog."""

import os
import signal
from collections.abc import Callable

import numpy as np
import pytest
from fake_arm import JOINTS, FakeArm

import o80
from o80_arms.fakes.dynamixel import (
    CURRENT,
    PWM,
    RETURN_DELAY,
    SHUTDOWN,
    WATCHDOG,
)

pytestmark = pytest.mark.parametrize("arm", ["koch"], indirect=True)
DRIVE_MODE, GAINS = (10, 1), ((84, 2), (82, 2), (80, 2))


def watchdogs(arm: FakeArm) -> list[int]:
    return [servo.get(WATCHDOG) for servo in arm.servos]


def test_a_first_start_sets_servos_up_as_lerobot_does(arm: FakeArm) -> None:
    for servo in arm.servos:
        servo.put(RETURN_DELAY, 250)
        servo.put(servo.MODE, 3)
        servo.put(SHUTDOWN, 1)
    robot = arm.started()
    assert [servo.get(RETURN_DELAY) for servo in arm.servos] == [0] * 6
    assert [servo.get(servo.MODE) for servo in arm.servos] == [4] * 5 + [5]
    assert [servo.get(SHUTDOWN) for servo in arm.servos] == [53] * 6
    assert [arm.servo("elbow_flex").get(gain) for gain in GAINS] == [1500, 0, 600]
    robot.burst(2)
    gripper = arm.servo("gripper")
    assert (gripper.get(PWM), gripper.get(CURRENT)) == (885, 875), "its force has a limit"
    assert watchdogs(arm) == [5] * 6
    robot.close()
    arm.line.wait_until_closed()
    assert watchdogs(arm) == [0] * 6, "or others could give the servos no goals"
    assert arm.torque == [1] * 6


def other_model(arm: FakeArm) -> None:
    arm.servo("shoulder_pan").put((0, 2), 1200)


def reversed_servo(arm: FakeArm) -> None:
    arm.servo("wrist_flex").put(DRIVE_MODE, 1)


def holding_in_another_mode(arm: FakeArm) -> None:
    roll = arm.servo("wrist_roll")
    roll.put(roll.MODE, 3)
    roll.put(roll.GOAL, roll.shown)
    roll.put(roll.TORQUE, 1)


def other_calibration(arm: FakeArm) -> None:
    arm.servo("elbow_flex").calibrate(3, 900, 3100)


def failed(arm: FakeArm) -> None:
    arm.servo("shoulder_lift").overload()


REFUSED: list[tuple[Callable[[FakeArm], None], str]] = [
    (other_model, r"shoulder_pan \(servo 1\) is of model 1200, but an XL430-W250 \(1060\)"),
    (reversed_servo, r"wrist_flex \(servo 4\) has the drive mode"),
    (holding_in_another_mode, r"wrist_roll \(servo 5\) has its torque on, so its register"),
    (other_calibration, r"elbow_flex: the calibration .* the servo has offset 3,"),
    (failed, r"shoulder_lift is overloaded and has switched itself off: free it"),
]


@pytest.mark.parametrize(("wrong", "words"), REFUSED, ids=[wrong.__name__ for wrong, _ in REFUSED])
def test_a_start_that_cannot_be_right_is_refused(
    arm: FakeArm, wrong: Callable[[FakeArm], None], words: str
) -> None:
    wrong(arm)
    before = arm.torque
    with pytest.raises(o80.Error, match=words):
        arm.started()
    assert sum(arm.torque) <= sum(before)


def test_turns_that_servos_count_or_forget_do_not_matter(arm: FakeArm) -> None:
    """Without power a servo forgets its turns, wherever its encoder goes from 4095 to 0."""
    arm.servo("elbow_flex").encoder += 4096
    arm.servo("gripper").encoder -= 4096
    before = arm.shown
    robot = arm.started()
    assert np.abs(np.subtract(arm.shown, before)).max() <= 1
    place = (2100 - (900 + 3100) / 2) * 2 * np.pi / 4095
    assert robot.latest().observed.joints[2] == pytest.approx(place)
    robot.add_command(["elbow_flex", "gripper"], [0.2, 0.4], duration=1.0)
    row = robot.burst(300)
    assert row.observed.joints[2] == pytest.approx(0.2, abs=0.01)
    assert row.observed.gripper == pytest.approx(0.4, abs=0.01)
    assert arm.servo("elbow_flex").shown > 4096


@pytest.mark.parametrize("joint", ["shoulder_pan", "shoulder_lift"])  # the first: all are silent
def test_an_overload_ends_with_a_restart_when_somebody_asks_for_it(
    arm: FakeArm, joint: str
) -> None:
    robot = arm.started(answer_timeout=0.25)
    lift = arm.servo(joint)
    lift.pull = -300.0  # what it carries
    robot.burst(2)
    lift.overload()
    for _ in range(4):
        robot.burst(1)
    halt = robot.halted
    assert halt is not None
    assert halt.text == f"{joint} is overloaded and has switched itself off: free it"
    assert "overload" in robot.latest().extended.health.tolist()
    assert lift.torque == 0
    robot.burst(30)
    with pytest.raises(o80.BackendHalted, match=r"`recover` restarts it"):
        robot.resume()
    lift.pull = 0.0
    robot.request("recover")
    while robot.burst(1).extended.link.fresh:  # until it is silent
        pass
    with pytest.raises(o80.BackendHalted, match="does not answer"):
        robot.resume()
    while not robot.burst(1).extended.link.fresh:
        pass
    robot.burst(10)
    assert (lift.failures, lift.torque) == (0, 0), "restarted, and without torque until a resume"
    assert lift.get(PWM) == 885, "it has forgotten what it was told"
    before = arm.shown
    robot.resume(accept_reading=True)
    robot.burst(150)
    assert robot.halted is None
    assert arm.torque == [1] * 6
    assert arm.strengths == [1.0] * 5 + [0.5]
    assert watchdogs(arm) == [5] * 6
    assert np.abs(np.subtract(arm.shown, before)).max() <= 10
    robot.add_command(joint, 0.2, duration=1.0)
    assert robot.burst(300).observed.joints[JOINTS.index(joint)] == pytest.approx(0.2, abs=0.01)


def test_servos_that_a_killed_process_left_and_others_relaxed_are_held_again(arm: FakeArm) -> None:
    for servo in arm.servos:
        servo.put(WATCHDOG, 255)  # takes no goal, no strength
        servo.put(PWM, 0)
    robot = arm.started()
    robot.burst(2)
    assert arm.strengths == [1.0] * 5 + [0.5]
    assert arm.torque == [1] * 6


def test_a_process_that_is_killed_leaves_an_arm_that_stops(arm: FakeArm) -> None:
    robot = o80.robots.load("koch")
    options = {**arm.options, "answer_timeout": 0.1}
    with robot.start(gap=30.0, **options) as process:
        with process.frontend() as frontend:
            frontend.add_command("elbow_flex", -0.2, duration=0.5)
            frontend.pulse_and_wait(timeout=60.0)
            frontend.add_command("elbow_flex", -1.0, duration=3.0)
            frontend.pulse()
        os.kill(process.pid, signal.SIGKILL)
    o80.clean("koch")
    arm.line.wait_until_closed()
    arm.line.pass_time(0.2)
    assert watchdogs(arm) == [255] * 6
    there = arm.shown
    arm.line.pass_time(1.0)
    assert arm.shown == there
    assert arm.torque == [1] * 6, "it holds"
    successor = arm.started()
    successor.add_command("elbow_flex", 0.0, duration=1.0)
    assert successor.burst(300).observed.joints[2] == pytest.approx(0.0, abs=0.01)
