"""Waits as tasks of asyncio: each in a thread of its own, which ends when the task is cancelled."""

import asyncio
import contextlib
import threading
from collections.abc import Callable
from typing import TypeVar, overload

from o80 import _core

Result = TypeVar("Result")


async def in_thread(wait: Callable[[], Result]) -> Result:
    """Runs a call that waits in a thread.

    A task that is cancelled cancels the call, and goes on when the thread has ended: within 50 ms.
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
        with contextlib.suppress(RuntimeError):  # a loop that was closed waits for nothing
            loop.call_soon_threadsafe(end, result, caught)

    thread = threading.Thread(target=run, name="o80 wait", daemon=True)
    thread.start()
    try:
        result = await asyncio.shield(ended)
    except asyncio.CancelledError:
        canceller.cancel()
        while not ended.done():
            # it may be cancelled again; how the call ends no longer matters
            with contextlib.suppress(Exception, asyncio.CancelledError):
                await asyncio.shield(ended)
        if not ended.cancelled():
            ended.exception()  # it was seen
        thread.join()
        raise
    except BaseException:
        canceller.cancel()  # the coroutine may have been closed: nobody waits any more
        if ended.done():
            thread.join()
        raise
    thread.join()  # it has nothing left to do
    return result


@overload
async def end_of(sent: _core.Batch) -> _core.Batch: ...
@overload
async def end_of(sent: _core.Burst) -> _core.Observation: ...
async def end_of(sent: _core.Batch | _core.Burst) -> _core.Batch | _core.Observation:
    """Waits for a batch, and gives it; or for a burst, and gives its last observation."""
    if isinstance(sent, _core.Burst):
        return await in_thread(sent.wait)
    await in_thread(sent.wait)
    return sent


async def next_of(stream: _core.Stream) -> _core.Observation:
    """The next observation of a stream.

    It is read by the task, not by the thread: a task that is cancelled loses none.
    """
    while not stream._ready:
        await in_thread(stream._await_row)
    return next(stream)
