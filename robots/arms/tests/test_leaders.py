"""The arm that is moved by hand, and the one that follows it."""

from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fake_arm import JOINTS, FakeArm

import o80


@pytest.fixture(params=["so101", "koch_leader"])
def hand(tmp_path: Path, request: pytest.FixtureRequest) -> Any:
    (tmp_path / "leader").mkdir()
    with ExitStack() as stack:
        yield FakeArm(tmp_path / "leader", stack, request.param)


def test_it_has_no_torque_and_is_followed_by_its_desired_states(hand: FakeArm) -> None:
    elbow = hand.servo("elbow_flex")
    elbow.put(elbow.GOAL, 2100)
    elbow.put(elbow.TORQUE, 1)
    hand.servo("wrist_roll").stand_at(40)  # a hand may hold it outside its range
    with o80.robots.load(f"{hand.kind.removesuffix('_leader')}_leader").inline(
        **hand.options
    ) as leader:
        assert hand.torque == [0] * 6
        elbow.stand_at(2200)
        row = leader.burst(4)
        assert row.observed.joints[2] != 0
        assert row.desired.joints.tolist() == row.observed.joints.tolist()
        leader.add_command("elbow_flex", 0.0, duration=0.1)
        leader.pulse()
        leader.burst(3)
        leader.add_command("elbow_flex", 0.0, duration=0.1)
        with pytest.raises(o80.NotCompleted):
            leader.pulse_and_wait(timeout=60)
        with pytest.raises(o80.errors.Error, match="a leader is moved by hand"):
            leader.request("hold")
        number = leader.halt("enough")
        leader.burst(1)
        leader.resume(number)
        leader.burst(2)
        assert hand.torque == [0] * 6, "no resume gives it torque"


def test_a_follower_goes_where_the_hand_is(hand: FakeArm, arm: FakeArm) -> None:
    with (
        o80.robots.load(f"{hand.kind.removesuffix('_leader')}_leader").inline(
            **hand.options
        ) as leader,
        arm.started() as follower,
    ):
        robots = o80.Teleoperation(leader, follower)
        assert [joint.follower for joint in robots.joints] == list(JOINTS)
        for _ in range(100):
            leader.burst(1)
            robots.step()
            follower.burst(1)
        assert robots.engaged
        for step in range(400):
            for servo in hand.line.servos.values():
                servo.stand_at(2100 + min(step, 200))
            leader.burst(1)
            robots.step()
            follower.burst(1)
        there, here = leader.latest().observed, follower.latest().observed
        np.testing.assert_allclose(here.joints, there.joints, atol=0.02)
        assert here.gripper == pytest.approx(there.gripper, abs=0.02)
        assert all(on == 1 for on in arm.torque)
