"""Teleoperation: a robot that is moved by hand, and another one that follows."""

import os
import pty
import random
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from room_sensor import Obedient

import o80
from o80.cli.teleop import _Session
from o80.datasets.episodes import episodes_of

SECOND = 1000  # iterations


class Arm(Obedient):
    """The one that a test moves stands for a hand."""

    actuators = ("wrist", "elbow", "lamp")


class Follower(Obedient):
    """With limits, and joints of another order."""

    actuators = ("elbow", "gripper", "wrist")
    limits = dict.fromkeys(
        actuators, o80.Limits(minimum=-1.0, maximum=1.0, speed=2.0, acceleration=15.0, jerk=500.0)
    )


@pytest.fixture
def hand(segment: str) -> Iterator[o80.Frontend]:
    with o80.robots.load(Arm).inline(f"{segment}-1") as leads:
        yield leads


@pytest.fixture
def arm(segment: str) -> Iterator[o80.Frontend]:
    with o80.robots.load(Follower).inline(f"{segment}-2") as follows:
        yield follows


def engage(robots: o80.Teleoperation) -> None:
    for _ in range(100):
        robots.leader.burst(10)
        robots.follower.burst(10)
        if robots.step():
            return
    raise AssertionError(robots.why)


def play(
    robots: o80.Teleoperation, hand: o80.Frontend, arm: o80.Frontend, *, steps: int, iterations: int
) -> list[bool]:
    """Runs both robots beside the steps; returns whether the follower followed in each."""
    followed = []
    for _ in range(steps):
        hand.burst(iterations)
        followed.append(robots.step())
        arm.burst(iterations)
    return followed


@pytest.mark.parametrize(
    ("text", "joint"),
    [
        ("elbow", o80.Joint("elbow", "elbow")),
        ("elbow=lower", o80.Joint("elbow", "lower")),
        ("elbow=-1*lower+0.3", o80.Joint("elbow", "lower", -1.0, 0.3)),
        ("a=2.5e-1*b[0]-.3", o80.Joint("a", "b[0]", 0.25, -0.3)),
        ("gripper=left.tip", o80.Joint("gripper", "left.tip")),
    ],
)
def test_a_joint_is_written_as_text(text: str, joint: o80.Joint) -> None:
    assert o80.Joint.parse(text) == joint


@pytest.mark.parametrize("text", ["", "=", "a=", "a=b*c", "a=two*b", "a=b+", "a=b=c", "a b"])
def test_another_text_is_refused(text: str) -> None:
    with pytest.raises(o80.InvalidArgument, match=r"FOLLOWER=SCALE\*LEADER\+OFFSET"):
        o80.Joint.parse(text)


def test_it_follows_a_hand_within_its_limits(hand: o80.Frontend, arm: o80.Frontend) -> None:
    choose = random.Random(3)
    robots = o80.Teleoperation(hand, arm)
    assert [joint.follower for joint in robots.joints] == ["elbow", "wrist"]
    engage(robots)
    for _ in range(300):
        if choose.random() < 0.1:
            places = [choose.uniform(-1.5, 1.5) for _ in range(3)]
            hand.add_command(None, places, duration=choose.uniform(0.5, 1.5), mode="overwrite")
        hand.burst(5)
        assert robots.step()
        arm.burst(5)
    play(robots, hand, arm, steps=600, iterations=5)  # the hand rests
    wrist, elbow, _ = hand.latest().observed
    assert arm.latest().observed.tolist() == [np.clip(elbow, -1, 1), 0, np.clip(wrist, -1, 1)]
    rows = arm.history()
    speed = np.abs(np.diff(rows.desired, axis=0)).max() * SECOND
    assert 0.5 < speed <= 2.0 * (1 + 1e-9)
    assert not rows.clamped.any(), "targets are within the bounds"
    assert robots.follower.halted is None


def test_scale_and_offset_and_near(segment: str, hand: o80.Frontend, arm: o80.Frontend) -> None:
    joints = [o80.Joint("gripper", "lamp", -2.0, 0.6)]
    robots = o80.Teleoperation(hand, arm, joints=joints, near=0.1)
    assert not any(play(robots, hand, arm, steps=100, iterations=10))
    assert robots.far == {"gripper": (0.6, 0.0)}
    assert robots.why == "move the leader to where the follower is"
    assert arm.latest().desired.tolist() == [0, 0, 0], "nothing moves before"
    hand.add_command("lamp", 0.28, iterations=10)
    hand.burst(10)
    engage(robots)
    assert robots.far == {}
    hand.add_command("lamp", 0.1, iterations=200)
    play(robots, hand, arm, steps=200, iterations=5)
    assert arm.latest().observed[1] == pytest.approx(0.4)
    # a halt ends it; after the resume both have to be near again
    number = arm.halt("enough")
    arm.burst(1)
    hand.add_command("lamp", 0.3, iterations=10)
    hand.burst(10)
    assert not robots.step()
    assert robots.why == f"'{arm.segment}' is halted: enough"
    arm.resume(number)
    arm.burst(1)
    assert not any(play(robots, hand, arm, steps=100, iterations=10))
    assert list(robots.far) == ["gripper"]
    assert arm.latest().observed[1] == pytest.approx(0.4)


@settings(max_examples=25)
@given(
    scale=st.floats(0.01, 200).flatmap(lambda size: st.sampled_from([size, -size])),
    offset=st.floats(-1, 1),
    leads=st.floats(-2, 2),
    follows=st.floats(-1, 1),
)
def test_the_leader_is_told_where_to_go_in_its_own_numbers(
    scale: float, offset: float, leads: float, follows: float
) -> None:
    name = f"test-teleop-{os.getpid()}"
    with (
        o80.robots.load(Arm).inline(f"{name}-1") as hand,
        o80.robots.load(Follower).inline(f"{name}-2") as arm,
    ):
        robots = o80.Teleoperation(hand, arm, joints=[o80.Joint("gripper", "lamp", scale, offset)])
        hand.add_command("lamp", leads, iterations=1)
        hand.burst(1)
        arm.add_command("gripper", follows, duration=2.0)
        arm.burst(5000)
        robots.step()
        for move in robots.moves:
            found = re.fullmatch(r"lamp from (\S+) to (\S+)", move)
            assert found
            assert float(found[1]) == pytest.approx(leads, abs=0.006)
            hand.add_command("lamp", float(found[2]), iterations=1)
            hand.burst(1)
            robots.step()
            assert robots.far == {}
            assert robots.moves == []


def test_the_sentence_names_the_leaders_joint(
    hand: o80.Frontend, arm: o80.Frontend, capsys: pytest.CaptureFixture[str]
) -> None:
    robots = o80.Teleoperation(hand, arm, joints=[o80.Joint("gripper", "lamp", -2.0, 0.6)])
    session = _Session(robots, "episode")
    hand.burst(1)
    robots.step()
    session.report()
    assert "move the leader's lamp from 0.00 to 0.30" in capsys.readouterr().err
    with pytest.raises(o80.InvalidArgument, match="scale must not be 0"):
        o80.Teleoperation(hand, arm, joints=[o80.Joint("gripper", "lamp", 0.0)])


def test_a_leader_that_jumps_is_not_followed(hand: o80.Frontend, arm: o80.Frontend) -> None:
    robots = o80.Teleoperation(hand, arm)
    engage(robots)
    hand.add_command("elbow", 0.8)  # an encoder that lost a turn, a reset
    assert not any(play(robots, hand, arm, steps=200, iterations=5))
    assert robots.far == {"elbow": (0.8, 0.0)}
    assert arm.latest().desired.tolist() == [0, 0, 0]


def test_a_leader_that_stands_still_between_bursts_floods_nobody(
    hand: o80.Frontend, arm: o80.Frontend
) -> None:
    robots = o80.Teleoperation(hand, arm)
    engage(robots)
    for _ in range(5):
        assert robots.step()
    arm.burst(1)
    taken = [each for each in arm.journal() if each.kind == "taken" and each.commands]
    assert len(taken) == 1
    # the batch says by which row of the leader it was decided
    row, seen = hand.latest(), taken[0].seen
    assert seen is not None
    assert (seen.epoch, seen.iteration) == (row.epoch, row.iteration)


def test_a_follower_that_another_controls_does_not_follow(
    hand: o80.Frontend, arm: o80.Frontend
) -> None:
    with o80.Frontend(arm.segment) as other:
        robots = o80.Teleoperation(hand, other)
        play(robots, hand, arm, steps=100, iterations=10)
        assert robots.engaged
        with arm.control():
            hand.burst(1)
            robots.step()
            arm.burst(2)
            assert not robots.step()
            assert "rejects commands" in robots.why
            assert "has exclusive control" in robots.why
        assert arm.halted is None


def leader(segment: str) -> o80.Backend:
    backend = o80.Backend(segment, ["elbow"], frequency=200)
    backend.publish([0.0])
    return backend


Led = tuple[o80.Backend, o80.Teleoperation]


@pytest.fixture
def led(segment: str, arm: o80.Frontend) -> Iterator[Led]:
    """The backend of a leader, and its teleoperation, which follows."""
    with leader(f"{segment}-1") as backend, o80.Frontend(f"{segment}-1") as hand:
        robots = o80.Teleoperation(hand, arm)
        while not robots.engaged:
            backend.step()
            backend.publish([0.0])
            robots.step()
            arm.burst(1)
        yield backend, robots


def test_silence_of_the_leader_halts_the_follower(
    segment: str, led: Led, arm: o80.Frontend
) -> None:
    _, robots = led
    assert not robots.step()
    assert robots.why == f"the leader '{segment}-1' has published nothing for 0.2 s"
    arm.burst(1)
    assert arm.halted is not None
    assert arm.halted.text == robots.why
    assert not robots.step()  # once is enough
    arm.resume(arm.halted.number)
    arm.burst(1)
    assert arm.halted is None
    assert not robots.step()  # type: ignore[unreachable]
    arm.burst(1)
    assert arm.halted is None


@pytest.mark.parametrize("how", ["halt", "end"])
def test_a_leader_that_halts_or_ends_halts_the_follower(
    segment: str, led: Led, arm: o80.Frontend, how: str
) -> None:
    backend, robots = led
    if how == "halt":
        backend.halt("a servo is silent")
        backend.step()
        backend.publish([0.0])
        robots.step()
    else:
        backend.close()
        with pytest.raises(o80.BackendGone):
            robots.step()
    arm.burst(1)
    assert arm.halted is not None
    said = "is halted: resume it first" if how == "halt" else "has ended"
    assert arm.halted.text == f"the leader '{segment}-1' {said}"


@pytest.mark.parametrize("how", ["halted", "far", "following"])
def test_a_follower_that_ends_ends_it(segment: str, how: str) -> None:
    with (
        o80.robots.load(Arm).inline(f"{segment}-1") as hand,
        o80.Frontend(f"{segment}-1") as seen,
    ):
        arm = o80.robots.load(Follower).inline(f"{segment}-2")
        with arm, o80.Frontend(f"{segment}-2") as other:
            robots = o80.Teleoperation(seen, other)
            play(robots, hand, arm, steps=100, iterations=10)
            if how == "far":
                hand.add_command("elbow", 0.8)
                hand.burst(1)
                assert not robots.step()
            if how == "halted":
                arm.halt()
                arm.burst(1)
            arm.close()
            hand.burst(1)
            with pytest.raises(o80.BackendGone):
                robots.step()


def test_a_leader_that_is_read_as_nothing_is_not_followed(led: Led, arm: o80.Frontend) -> None:
    backend, robots = led
    backend.step()
    backend.publish([np.nan])
    assert not robots.step()
    arm.burst(5)
    assert arm.halted is None
    for _ in range(200):
        backend.step()
        backend.publish([np.nan])
        assert not robots.step()


def test_who_waits_gives_signs_of_life(
    segment: str, hand: o80.Frontend, arm: o80.Frontend, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[str] = []
    monkeypatch.setattr(o80.Frontend, "keep_alive", lambda self: given.append(self.segment))
    robots = o80.Teleoperation(hand, arm)
    hand.add_command("elbow", 0.8)  # far away
    for _ in range(3):
        hand.burst(1)
        assert not robots.step()
    assert given == [arm.segment] * 3
    arm.halt()
    arm.burst(1)
    hand.burst(1)
    assert not robots.step()
    assert given == [arm.segment] * 4


def test_demonstrations_are_of_a_robot_that_follows(
    hand: o80.Frontend, arm: o80.Frontend, path: Path
) -> None:
    with o80.Frontend(arm.segment) as other, o80.Recording(path, arm) as recording:
        robots = o80.Teleoperation(hand, other)
        other.mark("episode: of a session that was killed")
        arm.burst(1)
        session = _Session(robots, "episode: wave")
        arm.burst(1)
        session.press(" ")  # nothing follows yet
        play(robots, hand, arm, steps=100, iterations=10)
        assert robots.engaged
        for how in ("kept", "halted", "discarded", "open at the end"):
            session.press(" ")
            arm.burst(20)
            if how == "kept":
                session.press(" ")
            if how == "discarded":
                session.press("x")
            if how == "halted":
                arm.halt()
                arm.burst(1)
                hand.burst(1)
                robots.step()
                session.report()
                arm.resume()
                while not robots.engaged:
                    hand.burst(10)  # type: ignore[unreachable]
                    arm.burst(10)
                    robots.step()
            arm.burst(20)
        session.end()
        arm.burst(1)
        recording.flush()
    found = episodes_of(o80.open(path))
    (kept,) = found.all
    assert (kept.task, kept.terminated, len(kept)) == ("wave", True, 20)
    assert len(found.left_out) == 4
    assert all("discarded" in why for why in found.left_out)


@pytest.mark.parametrize(
    ("joints", "text"),
    [
        (["elbow", "elbow"], "once"),
        (["elbow=foot"], "has no joint 'foot', it has wrist, elbow, lamp"),
        (["foot=elbow"], "has no joint 'foot', it has elbow, gripper, wrist"),
        ([], "once"),
    ],
)
def test_wrong_joints_are_refused(
    hand: o80.Frontend, arm: o80.Frontend, joints: list[str], text: str
) -> None:
    with pytest.raises(o80.InvalidArgument, match=text):
        o80.Teleoperation(hand, arm, joints=map(o80.Joint.parse, joints))


def test_robots_without_a_common_joint_are_refused(segment: str) -> None:
    with leader(f"{segment}-1"), o80.Backend(f"{segment}-2", ["right"]) as other:
        other.publish([0.0])
        with (
            o80.Frontend(f"{segment}-1") as hand,
            o80.Frontend(f"{segment}-2") as arm,
            pytest.raises(o80.InvalidArgument, match="share no name of a joint"),
        ):
            o80.Teleoperation(hand, arm)


def test_the_command_marks_demonstrations_by_keys(segment: str, path: Path) -> None:
    one, other = f"{segment}-1", f"{segment}-2"
    robot = o80.robots.load("two_joints")
    main, side = pty.openpty()
    words = ["o80", "teleop", one, other, "--task", "wave", "--silence", "60"]
    words += ["--near", "1"]  # no jump, however late a busy machine reads the hand
    with (
        robot.start(one, frequency=200) as leads,
        robot.start(other, frequency=200) as follows,
        leads.frontend() as hand,
        follows.frontend() as arm,
        o80.Recording(path, arm),
        subprocess.Popen(words, stdin=side, stdout=subprocess.PIPE, stderr=side) as command,
    ):
        os.close(side)
        shown = b""

        def until(text: str) -> None:
            nonlocal shown
            while text.encode() not in shown:
                shown += os.read(main, 4096)
            shown = shown.partition(text.encode())[2]

        def press(key: str) -> None:
            os.write(main, key.encode())

        try:
            until("follows")
            until("q ends")
            until("follows")  # after the head
            arm.add_command("elbow", 0.0)
            with pytest.raises(o80.NotCompleted, match="exclusive control"):
                arm.pulse_and_wait(timeout=60)
            for number, place, key in ((1, 0.5, " "), (2, 0.0, "x")):
                press(" ")
                until(f"demonstration {number}")
                hand.add_command("elbow", place, duration=0.5)
                hand.pulse_and_wait(timeout=60)
                while abs(arm.latest().observed[1] - place) > 0.1:
                    arm.wait_for_next(timeout=60)
                press(key)
                until("1 demonstration")
            press("q")
            assert command.stdout is not None
            said = command.stdout.read().decode()
            assert command.wait(60) == 0
        finally:
            command.kill()
            os.close(main)
    assert said.startswith("1 demonstration; delay from hand to motor")
    episodes = episodes_of(o80.open(path))
    (kept,) = episodes.all
    assert (kept.task, kept.terminated) == ("wave", True)
    assert np.ptp(kept.rows.observed[:, 1]) > 0.3
    assert len(episodes.left_out) == 1
    assert "discarded" in episodes.left_out[0]
