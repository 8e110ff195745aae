"""Both arms against fake servos: nothing moves at their start, nothing old passes as fresh."""

import json
import random
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fake_arm import JOINTS, RANGES, FakeArm

import o80
import o80_arms

STEP = 2 * np.pi / 4095  # [rad]
RATE = 150
KOCH = pytest.param("koch", marks=pytest.mark.check)  # the same manners: test_koch.py has its own
both = pytest.mark.parametrize("arm", ["so101", KOCH], indirect=True)


def degrees_of_lerobot(position: int, joint: str) -> float:
    smallest, largest = RANGES[JOINTS.index(joint)]
    return (position - (smallest + largest) / 2) * 360 / 4095


def test_they_are_found_by_their_names() -> None:
    assert o80.robots.load("so101").path == o80_arms.so101()
    assert o80.robots.load("koch").path == o80_arms.koch()


@both
def test_its_face(arm: FakeArm) -> None:
    robot = arm.started(speed_share=0.2)
    assert [each.name for each in robot.actuators] == list(JOINTS)
    assert [each.group for each in robot.actuators] == ["joints"] * 5 + ["gripper"]
    assert [each.numbers[0].unit for each in robot.actuators] == ["rad"] * 5 + ["1"]
    assert robot.actuators[2].numbers[0].limits.maximum == pytest.approx((3100 - 900) / 2 * STEP)
    if arm.kind == "so101":  # moved through more than the published arm has when it was calibrated
        assert robot.actuators[4].numbers[0].limits.maximum == 2.7438
    assert [each.numbers[0].limits.speed for each in robot.actuators] == [0.5] * 5 + [0.4]
    assert set(robot.requests) == {"hold", "relax", "strength", "recover"}


@both
def test_angles_are_those_of_lerobot_and_rows_those_of_the_servos(arm: FakeArm) -> None:
    for number, servo in arm.line.servos.items():
        servo.stand_at(2000 + 100 * number)
    row = arm.started().latest()
    degrees = np.degrees(row.observed.joints)
    wanted = [
        degrees_of_lerobot(position, joint)
        for joint, position in zip(JOINTS[:5], arm.shown[:5], strict=True)
    ]
    np.testing.assert_allclose(degrees, wanted, atol=1e-12)
    assert row.observed.gripper == (2600 - 2000) / (3450 - 2000)
    assert row.extended.link.fresh
    assert row.extended.health.tolist() == ["ok"] * 6
    volts = [servo.get(servo.VOLTAGE) / 10 for servo in arm.servos]
    assert row.extended.measured.voltage == pytest.approx(volts)


@both
def test_a_command_arrives(arm: FakeArm) -> None:
    robot = arm.started()
    robot.add_command(["elbow_flex", "gripper"], [0.5, 0.4], duration=1.0)
    row = robot.burst(2 * RATE)
    assert row.observed.joints[2] == pytest.approx(0.5, abs=2 * STEP)
    assert row.observed.gripper == pytest.approx(0.4, abs=2e-3)
    assert row.observed.joints[2] == pytest.approx(
        np.radians(degrees_of_lerobot(arm.servo("elbow_flex").shown, "elbow_flex"))
    )
    assert row.extended.link.lost == row.extended.link.damaged == 0


# ---------------------------------------------------------------------------------------------
# start


@both
@pytest.mark.parametrize("goal_switches_on", [True, False])
def test_nothing_moves_at_the_start_whatever_the_goals_were(
    arm: FakeArm, goal_switches_on: bool
) -> None:
    dice = random.Random(3)
    for _ in range(4):
        for servo, (smallest, largest) in zip(arm.servos, RANGES, strict=True):
            servo.goal_switches_on = goal_switches_on
            servo.power_up()
            servo.put(servo.GOAL, dice.randint(smallest, largest))
            servo.stand_at(dice.randint(smallest, largest))
        before = arm.shown
        robot = arm.started()
        robot.burst(20)
        assert np.abs(np.subtract(arm.shown, before)).max() <= 1
        assert robot.latest().desired.joints == pytest.approx(robot.latest().observed.joints)
        # full strength by now, half of it for the gripper
        strengths = arm.strengths
        assert strengths == [1.0] * 5 + [0.5]
        robot.close()
        arm.line.wait_until_closed()


@both
def test_an_arm_that_is_pulled_when_it_is_switched_on_has_little_strength(arm: FakeArm) -> None:
    lift = arm.servo("shoulder_lift")
    lift.needs, lift.pull = 0.5, 150.0
    robot = arm.started()
    robot.burst(1)
    assert robot.halted is not None
    assert "shoulder_lift moved when its torque was switched on" in robot.halted.text
    assert lift.strength == pytest.approx(0.3, abs=1e-3)
    assert lift.torque == 1, "or it would fall"


@both
def test_torque_that_is_on_stays_on_with_its_strength(arm: FakeArm) -> None:
    """As after a stop that holds: with 30 % of its strength the arm would sink."""
    for servo in arm.servos:
        servo.put(servo.GOAL, 2100)
        servo.put(servo.TORQUE, 1)
        servo.needs, servo.pull = 0.4, 500.0
    before = arm.shown
    robot = arm.started(gripper_strength=1.0)
    robot.burst(RATE)
    assert robot.halted is None
    assert np.abs(np.subtract(arm.shown, before)).max() <= 1


def unpowered(arm: FakeArm) -> None:
    arm.line.unplug(1)


def unplugged(arm: FakeArm) -> None:
    arm.line.unplug(3)


def other_model(arm: FakeArm) -> None:
    arm.servo("wrist_flex").put((3, 2), 2825)


def other_firmware(arm: FakeArm) -> None:
    arm.servo("wrist_flex").put((0, 2), 0x0A03)


def in_velocity_mode(arm: FakeArm) -> None:
    arm.servo("gripper").put((33, 1), 1)


def other_calibration(arm: FakeArm) -> None:
    arm.servo("elbow_flex").calibrate(3, 0, 4095)


def outside(arm: FakeArm) -> None:
    arm.servo("shoulder_pan").stand_at(3420)


def too_little_voltage(arm: FakeArm) -> None:
    arm.servo("wrist_roll").put((62, 1), 38)


def two_places(arm: FakeArm) -> None:
    arm.line.false[4] = [1000 + 500 * (i % 2) for i in range(40)]


def uncalibrated(arm: FakeArm) -> None:
    arm.file.write_text("{}")


REFUSED: list[tuple[Callable[[FakeArm], None], str]] = [
    (unpowered, r"no servo answers: is the power supply on\?"),
    (unplugged, r"elbow_flex \(servo 3\) does not answer: check its plug"),
    (other_model, r"wrist_flex \(servo 4\) is of model 2825"),
    (other_firmware, r"wrist_flex \(servo 4\) has another firmware"),
    (in_velocity_mode, r"gripper \(servo 6\) is not in position mode"),
    (
        other_calibration,
        r"elbow_flex: the calibration '.*black.json' has offset 0, range 900..3100, but the servo "
        r"has offset 3, range 0..4095. .*`o80 arms calibrate --write",
    ),
    (outside, r"shoulder_pan \(servo 1\) stands at step 3420, outside its range 750..3400"),
    (too_little_voltage, r"3.8 V at wrist_roll, at least 4.0 V"),
    (two_places, r"wrist_flex \(servo 4\) moved between its readings"),
    (uncalibrated, r"black.json: shoulder_pan: it is missing"),
]


@pytest.mark.parametrize(("wrong", "words"), REFUSED, ids=[wrong.__name__ for wrong, _ in REFUSED])
def test_a_start_that_cannot_be_right_is_refused_and_switches_no_torque_on(
    arm: FakeArm, wrong: Callable[[FakeArm], None], words: str
) -> None:
    wrong(arm)
    silent = wrong in (unpowered, unplugged)
    with pytest.raises(o80.Error, match=words):
        arm.started(**{"answer_timeout": 0.1} if silent else {})
    assert not any(arm.torque)


def test_a_joint_that_was_moved_too_little_when_it_was_calibrated_is_named(
    arm: FakeArm, capfd: pytest.CaptureFixture[str]
) -> None:
    with arm.started():
        assert capfd.readouterr().err == ""
    content = json.loads(arm.file.read_text())
    content["shoulder_lift"].update(range_min=1500, range_max=2700)
    arm.file.write_text(json.dumps(content))
    arm.servo("shoulder_lift").calibrate(content["shoulder_lift"]["homing_offset"], 1500, 2700)
    with arm.started():
        assert capfd.readouterr().err.splitlines()[-1] == (
            "shoulder_lift was moved through only 105 of 200 deg during its calibration: "
            "its zero may be wrong by up to 47 deg. Calibrate it again"
        )


def test_an_adapter_that_is_gone_at_any_moment_of_the_start_ends_it(arm: FakeArm) -> None:
    robot = arm.started()
    needed = arm.line.requests
    robot.close()
    assert needed > 100
    for share in np.linspace(0.02, 0.95, 9):
        arm.line.wait_until_closed()
        for servo in arm.servos:
            servo.power_up()
        arm.line.cut_at = arm.line.requests + int(share * needed)
        with pytest.raises(o80.Error, match="is unplugged" if share > 0.4 else None):
            arm.started(answer_timeout=0.05)
        arm.line.cut_at = None
        arm.line.plug()


@both
def test_without_a_calibration_it_says_how_to_get_one(
    arm: FakeArm, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HF_LEROBOT_CALIBRATION", str(arm.file.parent / "nothing"))
    with pytest.raises(o80.DriverError, match=r"no calibration was given.*--take NAME"):
        arm.started(calibration="")


def test_a_rate_that_the_bus_cannot_reach_is_refused(arm: FakeArm) -> None:
    arm.line.latency = 0.008  # never less, on any machine
    with pytest.raises(o80.DriverError, match=r"answers within .* Hz are possible, not 150 Hz"):
        arm.started(answer_timeout=0.0)


# ---------------------------------------------------------------------------------------------
# halts


def halted(robot: o80.Frontend, words: str, iterations: int) -> o80.Halt:
    """The halt with these words, which must come within so many iterations."""
    for _ in range(iterations + 1):
        robot.burst(1)
    halt = robot.halted
    assert halt is not None
    assert words in halt.text
    return halt


def resumed(robot: o80.Frontend, arm: FakeArm) -> None:
    """Resumes the robot: it holds where it is, with full strength half a second later."""
    before = arm.shown
    robot.burst(30)  # to rest
    assert robot.resume()
    robot.burst(RATE)
    assert robot.halted is None
    assert np.abs(np.subtract(arm.shown, before)).max() <= 10
    assert arm.strengths == [1.0] * 5 + [0.5]
    robot.add_command("wrist_flex", 0.3, duration=0.5)
    row = robot.burst(RATE)
    assert row.observed.joints[3] == pytest.approx(0.3, abs=2 * STEP)


@both
def test_a_silent_servo_halts_after_three_transfers_and_returns_where_it_stands(
    arm: FakeArm,
) -> None:
    robot = arm.started(answer_timeout=0.25)
    robot.add_command(["shoulder_pan", "elbow_flex"], [0.5, 0.5], duration=3.0)
    robot.burst(100)
    arm.line.unplug(3)
    halt = halted(robot, "elbow_flex (servo 3) does not answer: check its plug", 3)
    row = robot.burst(20)
    assert not row.extended.link.fresh
    assert row.extended.health.tolist()[2:] == ["silent"] * 4
    with pytest.raises(o80.BackendHalted, match=r"elbow_flex \(servo 3\) does not answer"):
        robot.resume()
    arm.line.plug_in(3)
    for number in (3, 4, 5, 6):  # they sank, and know nothing of their goals
        arm.line.servos[number].stand_at(2080)
    before = arm.shown
    robot.burst(20)
    assert arm.shown[2:] == before[2:], "goals would switch its torque on"
    assert robot.halted == halt
    robot.resume(accept_reading=True)
    robot.burst(RATE)
    assert np.abs(np.subtract(arm.shown, before)).max() <= 10
    assert arm.strengths == [1.0] * 5 + [0.5]


@both
def test_if_all_are_silent_it_asks_for_the_power_supply(arm: FakeArm) -> None:
    robot = arm.started()
    arm.line.unplug(1)
    halted(robot, "no servo answers: is the power supply on?", 3)
    arm.line.plug_in(1)
    while not robot.burst(1).extended.link.fresh:
        pass
    resumed(robot, arm)


def test_two_transfers_without_an_answer_are_no_halt(arm: FakeArm) -> None:
    robot = arm.started()
    arm.line.silent = {2}
    robot.burst(2)
    arm.line.silent = set()
    while not robot.burst(1).extended.link.fresh:
        pass
    assert robot.halted is None


@both
def test_an_adapter_that_is_gone_halts_at_once_and_is_opened_again(arm: FakeArm) -> None:
    robot = arm.started()
    robot.add_command("elbow_flex", -0.5, duration=0.5)
    robot.burst(RATE // 4)
    arm.line.cut()
    halted(robot, "the adapter", 1)
    robot.burst(30)
    with pytest.raises(o80.BackendHalted, match="is unplugged"):
        robot.resume()
    arm.line.plug()
    before = arm.shown
    robot.burst(RATE)
    assert np.abs(np.subtract(arm.shown, before)).max() <= 30, "but for what it still had to do"
    resumed(robot, arm)


def test_an_overload_halts_and_resume_gives_the_strength_back(arm: FakeArm) -> None:
    robot = arm.started()
    arm.servo("shoulder_lift").overload()
    halted(robot, "shoulder_lift is overloaded and has only 20 % of its strength: free it", 3)
    assert robot.latest().extended.health[1] == "overload"
    resumed(robot, arm)


def test_heat_halts_until_the_servo_is_cooler(arm: FakeArm) -> None:
    robot = arm.started()
    gripper = arm.servo("gripper")
    gripper.put(gripper.TEMPERATURE, 66)
    assert robot.burst(1).extended.health[5] == "heat", "a warning before the halt"
    assert robot.halted is None
    gripper.put(gripper.TEMPERATURE, 71)
    halted(robot, "gripper is too hot (71 C): it has switched itself off", 3)
    gripper.put(gripper.TEMPERATURE, 65)
    robot.burst(30)
    with pytest.raises(o80.BackendHalted, match="gripper is still too hot"):
        robot.resume()
    gripper.put(gripper.TEMPERATURE, 60)
    resumed(robot, arm)


def test_a_weak_supply_halts_until_it_is_right(arm: FakeArm) -> None:
    robot = arm.started()
    arm.servo("wrist_roll").put((62, 1), 39)
    halted(robot, "3.9 V at wrist_roll, at least 4.0 V and at most 8.0 V needed", 3)
    robot.burst(30)
    with pytest.raises(o80.BackendHalted, match=r"3\.9 V at wrist_roll"):
        robot.resume()
    arm.servo("wrist_roll").put((62, 1), 50)
    resumed(robot, arm)


@both
def test_torque_that_somebody_switched_off_halts_and_is_not_switched_on_by_goals(
    arm: FakeArm,
) -> None:
    robot = arm.started()
    roll = arm.servo("wrist_roll")
    roll.goal_switches_on = False
    roll.put(roll.TORQUE, 0)
    halted(robot, "somebody switched the torque of servo 5 (wrist_roll) off", 11)
    assert robot.latest().extended.health[4] == "torque_off"
    resumed(robot, arm)
    assert roll.torque == 1


def test_an_encoder_one_turn_off_halts_and_is_not_resumed_unseen(arm: FakeArm) -> None:
    robot = arm.started()
    before = robot.latest().observed.joints[0]
    pan = arm.servo("shoulder_pan")
    pan.put((31, 2), 700)  # as with an encoder that has lost a part of a turn
    pan.put(pan.GOAL, pan.shown)
    halted(robot, "shoulder_pan is read at an impossible position: has its encoder lost a turn?", 3)
    assert robot.latest().observed.joints[0] == before
    robot.burst(30)
    with pytest.raises(o80.BackendHalted, match="'shoulder_pan'"):
        robot.resume()
    assert robot.resume(accept_reading=True)
    assert robot.burst(1).observed.joints[0] == pytest.approx(before - 712 * STEP, abs=0.1)


def test_an_arm_that_does_not_follow_halts(arm: FakeArm) -> None:
    robot = arm.started()
    arm.servo("elbow_flex").needs = 2.0
    robot.add_command("elbow_flex", -0.8, duration=1.0)
    with pytest.raises(o80.BackendHalted, match=r"'elbow_flex' is observed at .* error limit"):
        robot.burst(RATE)


# ---------------------------------------------------------------------------------------------
# readings


@both
def test_a_damaged_answer_in_a_thousand_is_no_halt_and_no_wrong_value(arm: FakeArm) -> None:
    robot = arm.started(answer_timeout=0.25)
    arm.line.damages = 0.001
    dice = random.Random(5)
    for _ in range(30):
        robot.add_command("elbow_flex", dice.uniform(-1, 1), duration=0.3)
        for _ in range(100):
            row = robot.burst(1)
            if row.extended.link.fresh:
                observed = degrees_of_lerobot(arm.servo("elbow_flex").shown, "elbow_flex")
                assert np.degrees(row.observed.joints[2]) == pytest.approx(observed)
    assert arm.line.damaged > 5
    assert robot.halted is None
    link = robot.latest().extended.link
    assert link.damaged + link.late >= arm.line.damaged


def test_many_damaged_answers_halt(arm: FakeArm) -> None:
    robot = arm.started(answer_timeout=0.25)
    arm.line.damages = 0.05
    for _ in range(2 * RATE):
        robot.burst(1)
        if robot.halted is not None:
            break
    halt = robot.halted
    assert halt is not None
    assert "answers of a second are damaged: check the cables" in halt.text
    arm.line.damages = 0.0
    robot.burst(30)
    assert robot.resume()


def test_a_position_that_cannot_be_is_dropped(arm: FakeArm) -> None:
    robot = arm.started()
    before = robot.burst(1).observed.joints[2]
    arm.line.false[3] = [1500, 1400]
    rows = [robot.burst(1) for _ in range(3)]
    assert [row.extended.link.fresh for row in rows] == [False, False, True]
    assert [row.observed.joints[2] for row in rows] == [before] * 3
    assert robot.halted is None


@both
@pytest.mark.parametrize("after", [1, 2, 5])
def test_an_answer_that_comes_late_is_never_fresh(arm: FakeArm, after: int) -> None:
    robot = arm.started(answer_timeout=0.25)
    robot.add_command("elbow_flex", 0.9, duration=2.0)
    robot.burst(20)
    arm.line.late = [after]
    wrong = 0
    for _ in range(60):
        row = robot.burst(1)
        observed = degrees_of_lerobot(arm.servo("elbow_flex").shown, "elbow_flex")
        right = np.degrees(row.observed.joints[2]) == pytest.approx(observed)
        wrong += bool(row.extended.link.fresh and not right)
    assert wrong == 0
    assert robot.latest().extended.link.late == 6
    assert row.extended.link.fresh


def test_goals_at_the_wire_keep_the_limits(arm: FakeArm) -> None:
    robot = arm.started()
    dice = random.Random(7)
    arm.line.goals.clear()
    for _ in range(40):
        joint = dice.randrange(5)
        bound = robot.actuators[joint].numbers[0].limits.maximum
        robot.add_command(joint, dice.uniform(-bound, bound), mode="overwrite")
        robot.burst(dice.randint(1, 40))
    goals = np.array([list(each.values()) for each in arm.line.goals])[:, :5] * STEP
    speeds = np.diff(goals, axis=0) * RATE
    assert np.abs(speeds).max() <= 2.5 + 1.01 * STEP * RATE
    assert np.abs(np.diff(speeds, axis=0)).max() * RATE <= 20 + 2.01 * STEP * RATE**2
    assert np.ptp(goals, axis=0).min() > 0.3, "each of them moved"


def test_a_gripper_presses_no_harder_than_a_bit_beyond_where_it_stands(arm: FakeArm) -> None:
    robot = arm.started()
    gripper = arm.servo("gripper")
    gripper.needs = 2.0  # something is in it
    robot.add_command("gripper", 0.0, duration=1.0)
    robot.burst(2 * RATE)
    assert robot.halted is None
    share = (gripper.get(gripper.GOAL) - 2000) / 1450
    stands = (gripper.shown - 2000) / 1450
    assert share == pytest.approx(max(0.0, stands - 0.15), abs=1e-3)


# ---------------------------------------------------------------------------------------------
# requests and the end


@both
def test_strength_is_that_of_the_joints(arm: FakeArm) -> None:
    robot = arm.started(strength=0.8)
    assert arm.servo("elbow_flex").strength == pytest.approx(0.8)
    robot.request("strength", share=0.4)
    robot.burst(1)
    assert arm.strengths == [0.4] * 5 + [0.5]
    with pytest.raises(o80.RequestRejected, match="above 0"):
        robot.request("strength", share=1.5)


@both
def test_a_relaxed_arm_is_guided_by_hand_and_held_where_it_is_then(arm: FakeArm) -> None:
    robot = arm.started()
    robot.request("relax")
    robot.burst(1)
    assert arm.torque == [0] * 6
    arm.servo("elbow_flex").pull = 900.0  # by hand, 1.4 rad/s
    row = robot.burst(RATE // 2)
    assert robot.halted is None, "neither torque nor error are of interest now"
    assert row.observed.joints[2] > 0.7
    assert row.desired.joints[2] == pytest.approx(row.observed.joints[2], abs=0.02)
    assert row.extended.health.tolist() == ["ok"] * 6
    robot.add_command("wrist_roll", 0.5, duration=1.0)
    batch = robot.pulse()
    robot.burst(2)
    assert batch.statuses == [o80.Status.INTERRUPTED]
    arm.servo("elbow_flex").pull = 0.0
    before = arm.shown
    robot.burst(2)
    robot.request("hold")
    row = robot.burst(RATE)
    assert arm.shown == before
    assert arm.torque == [1] * 6
    robot.add_command("elbow_flex", 0.0, duration=1.0)
    assert robot.burst(2 * RATE).observed.joints[2] == pytest.approx(0.0, abs=2 * STEP)


def test_an_arm_that_is_halted_may_be_relaxed_and_resume_holds_it(arm: FakeArm) -> None:
    robot = arm.started()
    number = robot.halt("enough")
    robot.burst(30)
    robot.request("relax")
    robot.burst(2)
    assert arm.torque == [0] * 6
    assert robot.halted is not None
    robot.resume(number)
    robot.burst(2)
    assert arm.torque == [1] * 6


def test_recover_ends_an_overload(arm: FakeArm) -> None:
    robot = arm.started()
    lift = arm.servo("shoulder_lift")
    lift.overload()
    lift.needs, lift.pull = 0.25, 900.0  # it sinks
    halted(robot, "overloaded", 3)
    robot.burst(20)
    before = arm.shown
    robot.request("recover")
    assert robot.burst(20).extended.health[1] == "ok"
    assert np.abs(np.subtract(arm.shown, before)).max() <= 10, "it is not lifted to where it was"
    assert robot.halted is not None, "it may move when somebody resumes"


@both
@pytest.mark.parametrize(("at_stop", "torque"), [("hold", 1), ("relax", 0)])
def test_what_remains_at_the_end(arm: FakeArm, at_stop: str, torque: int) -> None:
    robot = arm.started(at_stop=at_stop)
    robot.add_command("gripper", 0.0, duration=0.2)
    robot.burst(10)
    robot.close()
    arm.line.wait_until_closed()
    assert arm.torque == [torque] * 6
    gripper = arm.servo("gripper")
    if torque:
        assert gripper.get(gripper.GOAL) == pytest.approx(gripper.shown, abs=2)


@both
def test_it_may_go_back_to_where_it_was_started_before_it_relaxes(arm: FakeArm) -> None:
    before = arm.shown
    robot = arm.started(at_stop="rest")
    robot.add_command("elbow_flex", -0.5, duration=1.0)
    robot.burst(2 * RATE)
    arm.line.goals.clear()
    robot.close()
    arm.line.wait_until_closed()
    assert np.abs(np.subtract(arm.shown, before)).max() <= 2
    elbow = np.array([goals[3] for goals in arm.line.goals]) * STEP
    assert np.abs(np.diff(elbow)).max() * RATE < 0.5 + 1.01 * STEP * RATE
    assert arm.torque == [0] * 6


def test_after_a_halt_it_moves_nowhere_when_it_is_stopped(arm: FakeArm) -> None:
    robot = arm.started(at_stop="rest")
    robot.add_command("elbow_flex", -0.5, duration=1.0)
    robot.burst(2 * RATE)
    robot.halt("something is in the way")
    robot.burst(2)
    there = arm.shown
    robot.close()
    arm.line.wait_until_closed()
    assert arm.shown == there
    assert arm.torque == [1] * 6


@both
def test_its_run_is_replayed_without_it(arm: FakeArm, tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    robot = arm.started()
    with o80.Recording(file, robot):
        robot.add_command("elbow_flex", 0.4, duration=0.3)
        robot.burst(60)
        robot.request("relax")
        arm.servo("wrist_flex").pull = 400.0
        robot.burst(60)
        arm.servo("wrist_flex").pull = 0.0
        robot.request("hold")
        arm.line.late = [0, 0, 1]
        robot.burst(6)
        arm.servo("shoulder_lift").overload()
        halted(robot, "overloaded", 30)
        if arm.kind == "koch":
            robot.request("recover")
            robot.burst(5)
            while not robot.burst(1).extended.link.fresh:
                pass
            robot.burst(30)
        robot.resume(accept_reading=True)
        robot.add_command("wrist_flex", 0.0, speed=1.0)
        robot.burst(60)
    robot.close()
    report = o80.replay(file)
    assert report.identical, report


@both
def test_in_real_time_it_runs_moves_and_gives_the_port_back(arm: FakeArm) -> None:
    """Nothing here is counted in time: a fake in Python, on a busy machine, is late."""
    arm.line.tick = None
    options = {**arm.options, "answer_timeout": 0.1}
    robot = o80.robots.load(arm.kind)
    with robot.start(gap=30.0, **options) as process, process.frontend() as started:
        started.add_command("elbow_flex", 0.3, duration=0.5)
        row = started.pulse_and_wait(timeout=60.0)
        assert row.desired.joints[2] == pytest.approx(0.3)
    arm.line.wait_until_closed()
    assert arm.servo("elbow_flex").torque == 1
    arm.started().close()
