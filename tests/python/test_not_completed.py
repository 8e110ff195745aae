"""Waits for commands raise NotCompleted if one of them ended otherwise than completed."""

import asyncio
import pickle
from collections.abc import Callable

import pytest

import o80

WAIT = 30.0  # [s] longer than any wait should take
LONG = 1000.0  # [s] of a motion that somebody ends

Wait = Callable[[o80.Frontend], object]


def by_pulse_and_wait(arm: o80.Frontend) -> object:
    return arm.pulse_and_wait(WAIT)


def by_batch(arm: o80.Frontend) -> None:
    arm.pulse().wait(WAIT)


def by_await(arm: o80.Frontend) -> object:
    async def wait() -> object:
        return await arm.pulse()

    return asyncio.run(wait())


def by_aio(arm: o80.Frontend) -> object:
    async def wait() -> object:
        return await arm.aio.pulse_and_wait(WAIT)

    return asyncio.run(wait())


WAITS = [by_pulse_and_wait, by_batch, by_await, by_aio]


def too_late(arm: o80.Frontend) -> None:
    """Adds a command that will be rejected."""
    arm.wait_for(5, WAIT)
    arm.add_command("elbow", 0.5, until=3)


@pytest.mark.parametrize("wait", WAITS)
def test_every_wait_raises_for_a_command_that_is_too_late(
    process: o80.robots.Process, wait: Wait
) -> None:
    with process.frontend() as arm:
        too_late(arm)
        with pytest.raises(o80.NotCompleted, match="'elbow' was rejected in iteration") as raised:
            wait(arm)

        (handle,) = raised.value.handles
        assert (handle.status, handle.reason) == (o80.Status.REJECTED, o80.Reason.LATE)
        (end,) = raised.value.ends
        assert end == (handle.iteration, handle.status, ("elbow",), handle.reason, handle.text)
        assert raised.value.observation.iteration >= 5
        assert isinstance(raised.value, o80.Error)


def test_with_check_false_they_only_wait(process: o80.robots.Process) -> None:
    with process.frontend() as arm:
        too_late(arm)
        assert arm.pulse_and_wait(WAIT, check=False).iteration >= 5
        too_late(arm)
        batch = arm.pulse()
        batch.wait(WAIT, check=False)
        assert batch.statuses == [o80.Status.REJECTED]
        too_late(arm)
        asyncio.run(arm.aio.pulse_and_wait(WAIT, check=False))
        with pytest.raises(o80.InvalidArgument, match="check must be True or False"):
            batch.wait(WAIT, check=1)  # type: ignore[arg-type]


def test_a_command_that_another_frontend_overwrote_raises(process: o80.robots.Process) -> None:
    with process.frontend() as arm, process.frontend() as other:
        arm.add_command("elbow", 1.0, duration=LONG)
        batch = arm.pulse()
        other.add_command("elbow", 0.25, iterations=5, mode="overwrite")
        other.pulse_and_wait(WAIT)

        with pytest.raises(o80.NotCompleted, match="by a command of another frontend") as raised:
            batch.wait(WAIT)
        assert [end.status for end in raised.value.ends] == [o80.Status.OVERWRITTEN]


def test_one_that_the_same_frontend_overwrote_does_not(process: o80.robots.Process) -> None:
    with process.frontend() as arm:
        arm.add_command("elbow", 1.0, duration=LONG)
        slow = arm.pulse()
        arm.add_command("elbow", 0.5, duration=LONG)  # of the same batch as its overwrite
        arm.add_command("elbow", 0.25, iterations=5, mode="overwrite")
        observation = arm.pulse_and_wait(WAIT)
        slow.wait(WAIT)

        assert slow.statuses == [o80.Status.OVERWRITTEN]
        assert observation.desired[1] == 0.25


def test_a_burst_overwrites_for_its_own_frontend_too(arm: o80.Frontend) -> None:
    arm.add_command("elbow", 1.0, iterations=1000)
    slow = arm.pulse()
    arm.burst(1)
    prepared = arm.prepared_burst(1, "elbow", mode="overwrite")
    prepared.targets[...] = 0.5
    prepared.run(WAIT)
    assert slow.statuses == [o80.Status.OVERWRITTEN]
    slow.wait(WAIT)


@pytest.mark.parametrize("by_another", [True, False])
def test_a_purge_raises_whoever_sent_it(process: o80.robots.Process, by_another: bool) -> None:
    with process.frontend() as arm, process.frontend() as other:
        arm.add_command("elbow", 1.0, duration=LONG)
        batch = arm.pulse()
        purge = (other if by_another else arm).purge("elbow")
        purge.wait(WAIT)

        with pytest.raises(o80.NotCompleted, match="'elbow' was purged in iteration"):
            batch.wait(WAIT)


def test_a_fresh_start_raises(process: o80.robots.Process) -> None:
    with process.frontend() as arm, process.frontend() as other:
        arm.add_command("elbow", 1.0, duration=LONG)
        batch = arm.pulse()
        other.request("reset", seed=1, timeout=WAIT)

        with pytest.raises(o80.NotCompleted, match="fresh start") as raised:
            batch.wait(WAIT)
        assert raised.value.ends[0].reason == o80.Reason.FRESH_START


def test_an_interrupt_of_the_driver_raises(segment: str) -> None:
    with o80.Backend(segment, ["a", "b"], frequency=100.0) as backend:
        backend.publish([0.0, 0.0])
        with o80.Frontend(segment) as arm:
            arm.add_command(["a", "b"], [1.0, 1.0], iterations=2)
            batch = arm.pulse()
            backend.step()
            backend.interrupt("b")
            backend.publish([0.0, 0.0])
            backend.step()
            backend.publish([0.0, 0.0])
            with pytest.raises(o80.NotCompleted, match="'a', 'b' were interrupted by the driver"):
                batch.wait(WAIT)


def test_a_batch_that_is_rejected_as_a_whole_raises(process: o80.robots.Process) -> None:
    with process.frontend() as arm:
        arm.wait_for(5, WAIT)
        for wait in (
            lambda: arm.pulse_and_wait(WAIT, at=3),
            lambda: arm.pulse(at=3).wait(WAIT),
        ):
            arm.add_command("elbow", 0.5)
            with pytest.raises(o80.NotCompleted, match=r"batch sent to .* was rejected: it came"):
                wait()


def test_a_request_of_a_batch_that_is_rejected_raises(process: o80.robots.Process) -> None:
    with process.frontend() as arm:
        arm.add_command("elbow", 0.1, iterations=3)
        arm.add_request("snapshot", slot=8)
        with pytest.raises(o80.NotCompleted, match="request 'snapshot' was rejected") as raised:
            arm.pulse_and_wait(WAIT)
        assert [end.actuators for end in raised.value.ends] == [()]


def test_a_halt_stays_an_error_of_its_own(process: o80.robots.Process) -> None:
    with process.frontend() as arm:
        arm.add_command("elbow", 1.0, duration=LONG)
        batch = arm.pulse()
        arm.halt("the ball is on the floor")
        with pytest.raises(o80.BackendHalted, match="the ball is on the floor"):
            batch.wait(WAIT)
        batch.wait(WAIT, check=False)
        arm.add_command("elbow", 1.0)
        with pytest.raises(o80.BackendHalted):
            arm.pulse_and_wait(WAIT)


def test_a_command_that_came_later_than_asked_has_completed(segment: str) -> None:
    limits = {"a": (-1.0, 1.0, 1.0)}
    with o80.Backend(segment, ["a"], limits=limits, frequency=100.0) as backend:
        backend.publish([0.0])
        with o80.Frontend(segment) as arm:
            arm.add_command("a", 0.05, iterations=1)  # too fast: it takes five
            batch = arm.pulse()
            while not batch.ended:
                desired = backend.step()
                assert desired is not None
                backend.publish(desired)
            batch.wait(WAIT)
            assert batch.handles[0].reason == o80.Reason.LIMITS


def test_a_bursting_robot_raises_when_its_commands_have_ended(bursting: o80.robots.Process) -> None:
    with bursting.frontend() as arm:
        arm.burst(5)
        arm.add_command("elbow", 0.5, until=3)
        with pytest.raises(o80.NotCompleted, match="'elbow' was rejected in iteration 6"):
            arm.pulse_and_wait(WAIT)
        arm.add_command("elbow", 0.5, iterations=4)
        assert arm.pulse_and_wait(WAIT).iteration == 10


def test_an_inline_robot_does_so_too(arm: o80.Frontend) -> None:
    arm.burst(5)
    arm.add_command("elbow", 0.5, until=3)
    with pytest.raises(o80.NotCompleted, match="'elbow' was rejected in iteration 6") as raised:
        arm.pulse_and_wait(WAIT)
    assert raised.value.observation.iteration == 6


def test_a_burst_does_not_judge_commands(arm: o80.Frontend) -> None:
    arm.burst(5)
    arm.add_command("elbow", 0.5, until=3)
    assert arm.burst(2).iteration == 7
    arm.add_command("elbow", 0.5, until=3)
    assert o80.burst({arm: 2})[arm].iteration == 9


def test_with_nothing_added_there_is_no_answer_of_a_robot_that_has_ended(segment: str) -> None:
    with o80.robots.load("two_joints").start(segment) as process, process.frontend() as arm:
        assert arm.pulse_and_wait(WAIT).iteration >= 0
        process.stop()
        with pytest.raises(o80.BackendStopped):
            arm.pulse_and_wait(WAIT)
        with pytest.raises(o80.BackendStopped):
            asyncio.run(arm.aio.pulse_and_wait(WAIT))


@pytest.mark.parametrize("is_bursting", [False, True])
def test_a_robot_that_stops_is_gone_and_not_an_end_of_commands(
    segment: str, is_bursting: bool
) -> None:
    with o80.Backend(segment, ["a"], bursting=is_bursting, frequency=100.0) as backend:
        backend.publish([0.0])
        with o80.Frontend(segment) as arm:
            arm.add_command(0, 1.0, iterations=50)
            batch = arm.pulse()
            if not is_bursting:
                assert backend.step() is not None
                backend.publish([0.0])
            backend.close()
            with pytest.raises(o80.BackendGone):
                batch.wait(WAIT)
            with pytest.raises(o80.BackendGone):
                batch.wait(WAIT, check=False)


def test_the_error_is_data(process: o80.robots.Process) -> None:
    with process.frontend() as arm:
        too_late(arm)
        with pytest.raises(o80.NotCompleted) as raised:
            arm.pulse_and_wait(WAIT)

    error = pickle.loads(pickle.dumps(raised.value))
    assert str(error) == str(raised.value)
    assert error.ends == raised.value.ends
    assert error.observation.iteration == raised.value.observation.iteration
    assert error.observation.desired.tolist() == [0.0, 0.0]


def test_no_control_is_still_said_as_such(process: o80.robots.Process) -> None:
    with process.frontend() as arm, process.frontend() as other, arm.control(WAIT):
        with pytest.raises(o80.ControlTaken), other.control(WAIT):
            pass
        other.add_command(0, 0.5)
        with pytest.raises(o80.NotCompleted, match="has exclusive control"):
            other.pulse_and_wait(WAIT)
