"""Waits for commands raise NotCompleted if one of them ended otherwise than completed."""

import asyncio
import pickle
from collections.abc import Callable

import pytest
from processes import WAIT

import o80

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
        again = pickle.loads(pickle.dumps(raised.value))
        assert (str(again), again.ends) == (str(raised.value), raised.value.ends)
        assert again.observation.desired.tolist() == [0.0, 0.0]


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


def test_a_burst_does_not_judge_commands(arm: o80.Frontend) -> None:
    arm.burst(5)
    arm.add_command("elbow", 0.5, until=3)
    assert arm.burst(2).iteration == 7
    arm.add_command("elbow", 0.5, until=3)
    assert o80.burst({arm: 2})[arm].iteration == 9
