"""Runs waiting calls for asyncio, each in a thread that ends when its task is cancelled."""

import asyncio
import contextlib
import threading
from collections.abc import Callable
from typing import TypeVar, overload

import o80._core as _core

Result = TypeVar("Result")


async def in_thread(wait: Callable[[], Result]) -> Result:
    """Runs a waiting call in a thread of its own and returns its result.

    A cancelled task cancels the call and continues when the thread has ended, within 50 ms.
    """
    loop = asyncio.get_running_loop()
    ended: asyncio.Future[Result] = loop.create_future()
    canceller = _core.Canceller()

    def end(result: Result | None, error: BaseException | None) -> None:
        if ended.done():
            return
        if error is None:
            ended.set_result(result)  # type: ignore[arg-type]
        else:
            ended.set_exception(error)

    def run() -> None:
        result: Result | None = None
        caught: BaseException | None = None
        try:
            result = canceller.call(wait)
        except BaseException as error:
            caught = error
        with contextlib.suppress(RuntimeError):  # the loop may be closed
            loop.call_soon_threadsafe(end, result, caught)

    thread = threading.Thread(target=run, name="o80 wait", daemon=True)
    thread.start()
    try:
        result = await asyncio.shield(ended)
    except asyncio.CancelledError:
        canceller.cancel()
        while not ended.done():
            # the task may be cancelled again; nothing needs the result of the call any more
            with contextlib.suppress(Exception, asyncio.CancelledError):
                await asyncio.shield(ended)
        if not ended.cancelled():
            ended.exception()  # mark it as retrieved
        thread.join()
        raise
    except BaseException:
        canceller.cancel()  # the coroutine was closed
        if ended.done():
            thread.join()
        raise
    thread.join()  # the call has ended
    return result


@overload
async def end_of(sent: _core.Batch) -> _core.Batch: ...
@overload
async def end_of(sent: _core.Burst) -> _core.Observation: ...
async def end_of(sent: _core.Batch | _core.Burst) -> _core.Batch | _core.Observation:
    """Waits for a batch and returns it, or for a burst and returns its last observation.

    Raises the exceptions of `wait`: NotCompleted if a command of the batch did not complete.
    """
    if isinstance(sent, _core.Burst):
        return await in_thread(sent.wait)
    await in_thread(sent.wait)
    return sent


async def next_of(stream: _core.Stream) -> _core.Observation:
    """Waits for the next observation of a stream and returns it.

    The task reads it, not the thread: a cancelled task loses no observation.
    """
    while not stream._ready:
        await in_thread(stream._await_row)
    return next(stream)
