"""The command `o80 arms`, against fake servos."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import fake_arm
import numpy as np
import pytest
from fake_arm import JOINTS, FakeArm
from typer.testing import CliRunner, Result

import o80
from o80_arms import calibration, cli
from o80_arms.bus import Bus, BusError
from o80_arms.calibration import Calibration
from o80_arms.fakes.dynamixel import RATE


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """LeRobot's folder of calibrations."""
    monkeypatch.setenv("HF_LEROBOT_CALIBRATION", str(tmp_path / "lerobot"))
    monkeypatch.setattr("o80_arms.bus.WAIT", 20.0)  # a busy machine
    return tmp_path / "lerobot" / "robots"


KOCH = pytest.param("koch", marks=pytest.mark.check)  # the same manners: test_koch.py has its own
both = pytest.mark.parametrize("arm", ["so101", KOCH], indirect=True)


def run(*words: str | Path) -> Result:
    return CliRunner().invoke(cli.app, [str(word) for word in words])


def test_a_port_before_the_command_is_refused_not_ignored() -> None:
    refused = run("--port", "/dev/ttyACM1", "relax").exception
    assert str(refused) == "--port goes after relax: `o80 arms relax --port ...`"


def test_o80_has_the_command() -> None:
    program = Path(sys.executable).parent / "o80"
    told = subprocess.run([program, "arms", "--help"], capture_output=True, text=True)
    assert "calibrate" in told.stdout, told.stderr
    assert "arms" in subprocess.run([program, "--help"], capture_output=True, text=True).stdout


@both
def test_it_lists_what_is_at_a_port(arm: FakeArm, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("o80_arms.bus.WAIT", 0.3)  # six numbers are of nobody
    told = run("--port", arm.line.port).output
    servos = {"so101": "STS3215, 5.2 V", "koch": "XL430-W250, XL330-M288, 5.0 V"}[arm.kind]
    assert f"servos 1, 2, 3, 4, 5, 6, {servos}, torque off" in told
    assert "no file has its calibration: `o80 arms calibrate --take NAME`" in told
    run("calibrate", "--port", arm.line.port, "--take", "black")
    assert "calibration black" in run("--port", arm.line.port).output
    arm.line.unplug(1)
    monkeypatch.setattr("o80_arms.bus.WAIT", 0.01)
    assert "no servo answers: is the power supply on?" in run("--port", arm.line.port).output


def test_a_port_that_is_in_use_names_its_user(arm: FakeArm) -> None:
    program = f"line = open({str(arm.line.port)!r}, 'rb', 0); print(flush=True); input()"
    with subprocess.Popen(
        [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as other:
        assert other.stdout is not None
        other.stdout.readline()
        used = rf"' \(pid {other.pid}\) has {arm.line.port} open: stop it first"
        with pytest.raises(BusError, match=used):
            Bus(arm.line.port)
        with pytest.raises(o80.DriverError, match=used):
            arm.started()
        other.communicate(b"\n")


@both
def test_take_makes_the_file_that_lerobot_would_make(
    arm: FakeArm, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("o80_arms.bus.WAIT", 0.3)  # one protocol is of nobody
    run("calibrate", "--port", arm.line.port, "--take", "black")
    arm.line.wait_until_closed()
    file = folder / {"so101": "so_follower", "koch": "koch_follower"}[arm.kind] / "black.json"
    assert json.loads(file.read_text()) == fake_arm.calibration()
    assert arm.started(calibration="black").latest().extended.link.fresh


@both
def test_write_puts_a_file_into_the_servos_for_good(
    arm: FakeArm, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("o80_arms.bus.WAIT", 0.3)  # one protocol is of nobody
    other = {**fake_arm.calibration()}
    other["elbow_flex"] = {**other["elbow_flex"], "homing_offset": -7, "range_max": 3000}
    arm.file.write_text(json.dumps(other))
    with pytest.raises(o80.DriverError, match=r"elbow_flex: the calibration .* --write"):
        arm.started()
    arm.line.wait_until_closed()
    assert run("calibrate", "--port", arm.line.port, "--write", arm.file).exit_code == 0
    arm.line.wait_until_closed()
    arm.line.unplug(1)
    arm.line.plug_in(1)
    assert arm.started().latest().extended.link.fresh


@both
def test_a_calibration_by_hand_has_its_middle_far_from_the_end_of_the_encoder(
    arm: FakeArm, monkeypatch: pytest.MonkeyPatch
) -> None:
    ends = {joint: (500.0 * i, 500.0 * i + 2300) for i, joint in enumerate(JOINTS, 1)}
    # some ranges go past 4095
    path = [*np.linspace(0.5, 0, 30), *np.linspace(0, 1, 60)]

    def moved_on() -> bool:
        share = path.pop(0)
        for joint, (smallest, largest) in ends.items():
            arm.servo(joint).encoder = smallest + share * (largest - smallest)
        return not path

    monkeypatch.setattr("o80_arms.bus.WAIT", 0.3)  # one protocol is of nobody
    monkeypatch.setattr(cli, "pressed_enter", moved_on)
    moved_on()
    with cli.opened(arm.line.port) as bus:
        joints = cli.moved_by_hand(bus)
        assert cli.held_by(bus) == joints
    for joint, (smallest, largest) in ends.items():
        found = joints[joint]
        assert (found.smallest, found.largest) == (2047 - 1150, 2047 + 1150), joint
        servo = arm.servo(joint)
        servo.encoder = (smallest + largest) / 2
        assert servo.shown % 4096 == 2047
    calibration.write(arm.file, joints)
    row = arm.started().latest()
    assert row.observed.joints == pytest.approx(np.zeros(5), abs=1e-9)


@both
def test_a_calibration_by_hand_goes_on_after_lost_answers(
    arm: FakeArm, monkeypatch: pytest.MonkeyPatch
) -> None:
    shares = [0.0, 1.0]

    def moved_on() -> bool:
        share = shares.pop(0)
        for servo in arm.servos:
            servo.encoder = 900 + share * 1500
        return not shares

    moved_on()
    shares = [1.0, 0.0]
    monkeypatch.setattr("o80_arms.bus.WAIT", 0.3)  # one protocol is of nobody
    monkeypatch.setattr(cli, "pressed_enter", moved_on)
    with cli.opened(arm.line.port) as bus:
        bus.wait = 0.05
        arm.line.damages = 0.5
        joints = cli.moved_by_hand(bus)
        arm.line.damages = 0.0
        assert arm.line.damaged > 20
        assert {each.largest - each.smallest for each in joints.values()} == {1500}
        assert cli.held_by(bus) == joints


def test_doubts_about_a_range_name_the_error_of_its_zero() -> None:
    whole = {joint: Calibration(0, 500, 3500) for joint in JOINTS}
    assert calibration.doubts(whole) == []
    half = {**whole, "shoulder_lift": Calibration(0, 1000, 2490)}
    assert calibration.doubts(half) == [
        "shoulder_lift was moved through only 131 of 200 deg during its calibration: its zero "
        "may be wrong by up to 35 deg"
    ]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("[]", "list indices"),
        ("{}", "'shoulder_pan' is missing"),
        ('{"shoulder_pan": {"homing_offset": 0, "range_min": 0}}', "'range_max' is missing"),
        ("range 2000..2000", "shoulder_pan has offset 0, range 2000..2000"),
        ("range 1.5..2000", "shoulder_pan has offset 0, range 1.5..2000"),
    ],
)
def test_a_file_that_is_no_calibration_is_refused_with_a_cure(
    tmp_path: Path, text: str, why: str
) -> None:
    file = tmp_path / "black.json"
    if text.startswith("range"):
        smallest, largest = text.removeprefix("range ").split("..")
        numbers = {"homing_offset": 0, "range_min": float(smallest), "range_max": int(largest)}
        if smallest == "2000":
            numbers["range_min"] = 2000
        text = json.dumps(dict.fromkeys(JOINTS, numbers))
    file.write_text(text)
    with pytest.raises(calibration.CalibrationError, match="--take NAME") as refused:
        calibration.read(file)
    assert why in str(refused.value)


def test_nothing_is_written_if_a_servo_cannot_keep_all(arm: FakeArm) -> None:
    joints = {joint: Calibration(0, 500, 3500) for joint in JOINTS}
    calibration.write(arm.file, {**joints, "gripper": Calibration(2048, 500, 3500)})
    before = [servo.shown for servo in arm.servos]
    refused = run("calibrate", "--write", arm.file, "--port", arm.line.port)
    assert "an offset of at most 2047, got 2048" in str(refused.exception)
    assert [servo.shown for servo in arm.servos] == before


def test_an_offset_that_a_servo_cannot_keep_is_one_step_less() -> None:
    assert Calibration.of_motion(4095 - 1000, 4095 + 1000).offset == 2047


@both
def test_servos_are_numbered_one_after_the_other(
    arm: FakeArm, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("o80_arms.bus.WAIT", 0.3)  # a servo that has another number is silent
    monkeypatch.setattr("o80_arms.bus.DynamixelBus.ALL", 0.1)
    kind, models = cli.ARMS[arm.kind]
    every, delivered = list(arm.line.servos.values()), RATE if arm.kind == "koch" else (5, 1)
    for servo in every:
        servo.put(servo.ID, 1)
        servo.put(delivered, 1)
        servo.keep()
    plugged: list[dict[int, Any] | None] = []  # one after the other; None: two answer at once

    def found(bus: Bus) -> list[int] | None:
        now = plugged.pop(0) if plugged else arm.line.servos
        if now is None:
            return None
        arm.line.servos = now
        while not (there := real(bus)) and now:
            pass  # a busy machine
        return there

    real = kind.found
    monkeypatch.setattr(kind, "found", found)
    other = every[0]
    other.put(other.MODEL, 1060)
    plugged = [{}, None, None, {1: other}]
    with cli.opened(arm.line.port, kind) as bus:
        for number in range(6, 0, -1):
            servo = every[number - 1]
            plugged.append({1: servo})
            if number == 6:
                servo.put(servo.ID, 7)  # whatever it had
                plugged[-1] = {7: servo}
            servo.put(servo.MODEL, models[number - 1])
            before = None if number == 6 else number + 1
            bus.number(cli.next_servo(bus, models[number - 1], before), number)
            assert list(arm.line.servos) == [number]
            arm.line.servos = {number: servo}
            servo.power_up()
            assert servo.get(servo.ID) == number
            assert bus.read(number, bus.ID) == number, "at our rate"
            plugged = [{number: servo}, {}] if number % 2 else [{number: servo}]
    its, needed = kind.MODELS.get(1060, "1060"), kind.MODELS[models[5]]
    assert capsys.readouterr().out.splitlines() == [
        "Several servos answer: leave one only.",
        f"This servo is of model {its}, and one of model {needed} is needed.",
    ]


def test_a_servo_with_the_number_of_the_one_before_is_taken_when_that_is_gone(
    arm: FakeArm, monkeypatch: pytest.MonkeyPatch
) -> None:
    there: list[list[int]] = [[3], [3], [], [9], [3]]  # 9: its plug has no contact any more
    monkeypatch.setattr("o80_arms.bus.WAIT", 0.1)
    with cli.opened(arm.line.port) as bus:
        monkeypatch.setattr(bus, "found", lambda: there.pop(0))
        assert cli.next_servo(bus, 777, before=3) == 3
    assert there == []


def test_number_says_which_servo_comes_next(arm: FakeArm, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Bus, "found", lambda bus: sorted(arm.line.servos)[-1:])
    monkeypatch.setattr(Bus, "number", lambda bus, servo, number: arm.line.servos.pop(servo))
    monkeypatch.setattr("o80_arms.bus.WAIT", 0.3)  # those that are numbered are silent
    told = run("number", "so101_leader", "--port", arm.line.port).output.splitlines()
    assert told[:2] == [
        "Connect the servo of gripper (STS3215), and no other.",
        "gripper has the number 6",
    ]
    assert told[-1] == "Connect all of them, then `o80 arms calibrate --leader --name NAME`."
    assert len(told) == 13


@both
def test_relax_and_check(arm: FakeArm, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("o80_arms.bus.WAIT", 0.3)
    elbow, lift = arm.servo("elbow_flex"), arm.servo("shoulder_lift")
    elbow.put(elbow.TORQUE, 1)
    lift.overload()
    told = run("relax", "--port", arm.line.port)
    assert "6 servos have no torque" in told.output
    assert not any(arm.torque)
    arm.line.pass_time(0.1)
    assert lift.alarms == 0, "torque was off, or it was restarted"
    told = run("check", "--port", arm.line.port)
    assert "0 of 100 missed" in told.output
    assert "goes on behind a silent servo: no" in told.output
    if arm.kind == "so101":
        assert "a goal switches torque on: yes" in told.output
    else:
        assert "torque makes the place the goal: no" in told.output
    assert not any(arm.torque)


def test_a_leader_has_its_own_calibrations(
    arm: FakeArm, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run("calibrate", "--port", arm.line.port, "--take", "blue", "--leader")
    file = folder.parent / "teleoperators" / "so_leader" / "blue.json"
    assert calibration.read(file)["elbow_flex"].smallest == 900
    refused = run("calibrate", "--port", arm.line.port, "--write", "blue")
    assert "there is no calibration 'blue'" in str(refused.exception)
    done = run("calibrate", "--port", arm.line.port, "--write", "blue", "--leader")
    assert f"read from {file}" in done.output
    monkeypatch.setattr("o80_arms.bus.WAIT", 0.3)  # six numbers are of nobody
    assert "calibration blue" in run("--port", arm.line.port).output
