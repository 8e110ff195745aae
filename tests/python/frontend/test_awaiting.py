"""Waits as tasks of asyncio: batches, bursts, streams, and the verbs of `aio`."""

import asyncio
import functools
import threading
from collections.abc import Awaitable, Callable, Coroutine
from typing import Any, Literal

import pytest
from processes import WAIT

import o80


def awaited(test: Callable[..., Coroutine[Any, Any, None]]) -> Callable[..., None]:
    """Runs a test in a loop of its own."""

    @functools.wraps(test)
    def run(**fixtures: Any) -> None:
        asyncio.run(test(**fixtures))

    return run


def waiting_threads() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == "o80 wait"]


async def started() -> None:
    """Until a task waits in its thread."""
    while not waiting_threads():
        await asyncio.sleep(0)


async def cancelled(waits: Coroutine[Any, Any, object]) -> None:
    """Cancels a task after it began to wait."""
    task = asyncio.create_task(waits)
    await started()
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task


@awaited
async def test_a_batch_is_awaited(process: o80.robots.Process) -> None:
    with process.frontend() as arm:
        arm.add_command("elbow", 0.2, iterations=20)
        batch = await arm.pulse()
        assert batch.statuses == [o80.Status.COMPLETED]
        assert (await batch).last_iteration == batch.last_iteration
    assert not waiting_threads()


@awaited
async def test_a_burst_is_awaited(bursting: o80.robots.Process) -> None:
    with bursting.frontend() as arm:
        assert (await arm.burst(5, wait=False)).iteration == 5
        assert (await arm.aio.burst(3, timeout=WAIT)).iteration == 8
        rows = await o80.burst({arm: 2}, wait=False)
        assert rows[arm].iteration == 10
        arm.add_command("elbow", 0.2, iterations=7)
        assert (await arm.aio.pulse_and_wait(WAIT)).iteration == 17


@awaited
async def test_an_inline_robot_is_awaited(arm: o80.Frontend) -> None:
    assert (await arm.aio.burst(5)).iteration == 5
    arm.add_command("elbow", 0.2, iterations=7)
    assert (await arm.aio.pulse_and_wait()).iteration == 12
    await arm.aio.request("reset", seed=3)
    arm.add_command("elbow", 0.5, until=3)
    with pytest.raises(o80.NotCompleted):
        await arm.aio.pulse_and_wait()


CALLS: list[Callable[[o80.Frontend], Awaitable[object]]] = [
    lambda arm: arm.aio.wait_for(10**9),
    lambda arm: arm.aio.wait_for_next(),
    lambda arm: anext(aiter(arm.stream())),
    lambda arm: arm.aio.burst(10**12),
    lambda arm: arm.aio.pulse_and_wait(),
    lambda arm: o80.burst({arm: 10**12}, wait=False),
]


@pytest.mark.parametrize("call", CALLS)
@awaited
async def test_a_cancelled_task_leaves_no_thread(
    bursting: o80.robots.Process, call: Callable[[o80.Frontend], Awaitable[object]]
) -> None:
    with bursting.frontend() as arm:
        arm.add_command("elbow", 1.0, iterations=10**9)

        async def wait() -> None:
            await call(arm)

        await cancelled(wait())
        assert not waiting_threads()
        # what of a burst was left is cancelled: the next one begins at once
        assert arm.burst(1, timeout=WAIT).iteration > 0


def test_an_inline_burst_is_cancelled_with_its_task(arm: o80.Frontend) -> None:
    asyncio.run(cancelled(arm.aio.burst(10**12)))
    assert not waiting_threads()


@pytest.mark.parametrize("on_error", ["purge", "continue"])
@awaited
async def test_a_cancelled_wait_for_commands_ends_them_as_an_error_does(
    process: o80.robots.Process, on_error: Literal["purge", "continue"]
) -> None:
    with o80.Frontend(process.segment, WAIT, on_error=on_error) as arm:
        arm.add_command("elbow", 1.0, iterations=10**9)
        await cancelled(arm.aio.pulse_and_wait())
        # an iteration that began after both batches were sent has taken them
        row = arm.wait_for(arm.published + 3, timeout=WAIT)
        assert row.active[1] == (on_error == "continue")


@awaited
async def test_a_cancelled_task_loses_no_row(process: o80.robots.Process) -> None:
    with process.frontend() as arm:
        stream = arm.stream(timeout=WAIT)
        first = await anext(stream)
        seen = [first.iteration, (await arm.aio.wait_for_next(WAIT)).iteration]
        for _ in range(50):
            for which, wait in enumerate((stream.__anext__, arm.aio.wait_for_next)):
                task = asyncio.ensure_future(wait())
                await asyncio.sleep(0)
                task.cancel()
                row = (await asyncio.gather(task, return_exceptions=True))[0]
                if isinstance(row, asyncio.CancelledError):
                    row = await wait()
                assert isinstance(row, o80.Observation)
                assert row.missed == 0
                assert row.iteration == seen[which] + 1
                seen[which] = row.iteration


def test_the_end_of_the_loop_ends_all_waits(bursting: o80.robots.Process) -> None:
    with bursting.frontend() as arm:

        async def leave() -> None:
            asyncio.ensure_future(arm.aio.wait_for_next())  # noqa: RUF006
            await started()

        asyncio.run(leave())
        assert not waiting_threads()


@awaited
async def test_the_end_of_the_backend_is_raised(bursting: o80.robots.Process) -> None:
    with bursting.frontend() as arm:
        task = asyncio.create_task(arm.aio.wait_for_next())
        await started()
        await asyncio.to_thread(bursting.stop)
        with pytest.raises(o80.BackendStopped):
            await task


@awaited
async def test_what_is_added_while_a_task_waits_is_not_sent_with_it(
    bursting: o80.robots.Process,
) -> None:
    with bursting.frontend() as arm:
        arm.add_command("elbow", 0.1, iterations=3)
        task = asyncio.create_task(arm.aio.pulse_and_wait(WAIT))
        await asyncio.sleep(0)
        arm.add_command("elbow", 0.9, iterations=3)
        await task
        assert arm.added == 1
        arm.forget_added()
