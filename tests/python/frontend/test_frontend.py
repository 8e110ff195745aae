"""A frontend: its life, what it knows of its robot, and what it leaves."""

import pytest
from processes import WAIT

import o80


def test_it_knows_its_robot(arm: o80.Frontend, segment: str) -> None:
    assert arm.robot == "two_joints"
    assert arm.segment == segment
    assert [actuator.name for actuator in arm.actuators] == ["shoulder", "elbow"]
    assert arm.actuators[1].index == 1
    assert (arm.actuators[1].minimum, arm.actuators[1].maximum) == (-3.0, 3.0)
    assert arm.actuators[0].when_idle == "hold"
    assert list(arm.requests) == ["reset", "snapshot", "restore", "home"]
    assert arm.frequency == pytest.approx(1000.0)
    assert arm.period == pytest.approx(0.001)
    assert arm.bursting
    assert arm.alive
    assert [field["name"] for field in arm.schema["extended"]["fields"]] == ["homing", "effort"]


def test_leaving_a_with_block_lets_motion_complete(process: o80.robots.Process) -> None:
    with process.frontend() as watcher:
        with process.frontend() as arm:
            arm.add_command(0, 1.0, iterations=20)
            arm.pulse()
        while watcher.latest().desired[0] < 1.0:
            watcher.wait_for_next(WAIT)


def test_an_error_in_a_with_block_purges_what_the_frontend_sent(
    bursting: o80.robots.Process,
) -> None:
    with bursting.frontend() as other:
        other.add_command(1, 1.0, iterations=100)
        kept = other.pulse()
        batch = fail_in(bursting.frontend())
        other.burst(1)

        assert batch.statuses == [o80.Status.PURGED]
        assert kept.statuses == [o80.Status.ACTIVE]


def fail_in(frontend: o80.Frontend) -> o80.Batch:
    """Sends a command of many iterations and leaves its block by an exception."""
    with pytest.raises(ZeroDivisionError), frontend as arm:  # noqa: PT012
        arm.add_command(0, 1.0, iterations=100)
        batch = arm.pulse()
        arm.add_command(0, 2.0)  # never pulsed, and not worth a warning any more
        raise ZeroDivisionError
    return batch


def test_control_within_control_changes_nothing(process: o80.robots.Process) -> None:
    def refused_reason(other: o80.Frontend) -> o80.Reason | None:
        other.add_command(0, 1.0)
        sent = other.pulse()
        sent.wait(WAIT, check=False)
        return sent.handles[0].reason if sent.statuses == [o80.Status.REJECTED] else None

    with process.frontend() as arm, process.frontend() as other:
        with arm.control():
            with arm.control():
                assert refused_reason(other) == o80.Reason.EXCLUSIVE
            assert refused_reason(other) == o80.Reason.EXCLUSIVE
            with pytest.raises(o80.ControlTaken), other.control():
                pass
        assert refused_reason(other) is None
        with other.control():
            assert refused_reason(arm) == o80.Reason.EXCLUSIVE


def test_a_reader_takes_no_lane_and_cannot_command(process: o80.robots.Process) -> None:
    with o80.Frontend(process.segment, read_only=True) as reader:
        assert reader.latest().iteration >= 0
        assert reader.wait_for_next(WAIT).iteration > 0
        reader.add_command(0, 0.5)
        with pytest.raises(o80.ReadOnly, match=process.segment):
            reader.pulse()
        reader.forget_added()


def test_it_refuses_to_attach_again_to_another_robot(segment: str) -> None:
    with o80.robots.load("two_joints").start(segment) as process:
        arm = process.frontend()
    with o80.Backend(segment, ["a"]) as backend:
        backend.publish([0.0])
        with pytest.raises(o80.SchemaMismatch, match="open a new frontend"):
            arm.reattach()
    arm.close()


def test_a_frontend_of_a_halted_robot_says_so(segment: str) -> None:
    with o80.robots.load("two_joints").inline(segment, frequency=500) as arm:
        assert repr(arm).endswith("(two_joints), bursting at 500 Hz>")
        arm.halt("too hot")
        assert repr(arm).endswith("bursting at 500 Hz, halted: too hot>")
