"""The waiting methods of a frontend, for programs on asyncio."""

import asyncio
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, SupportsIndex

import o80._core as _core
from o80.base.awaiting import in_thread
from o80.base.words import LateWord, ModeWord, ProfileWord, StartWord

if TYPE_CHECKING:
    from o80.frontend.commander import Commander, Tolerance


class Waits:
    """The waiting methods of a frontend as coroutines: `await arm.aio.wait_for_next()`.

    Arguments, results and exceptions are those of the methods with the same names. Several tasks
    may wait at the same time. A cancelled task continues within 50 ms; the rest of its burst is
    then cancelled too, as after a timeout. Commands that the task has pulsed continue; a cancelled
    `pulse_and_wait` purges the commands of its frontend, like an error in a `with` block, unless
    `on_error` is "continue".
    """

    def __init__(self, frontend: "Commander") -> None:
        self._frontend = frontend

    async def wait_for(self, iteration: int, timeout: float | None = None) -> _core.Observation:
        """Waits for the observation of an iteration; see `Frontend.wait_for`."""
        frontend = self._frontend
        return await in_thread(lambda: frontend.wait_for(iteration, timeout))

    async def wait_for_next(self, timeout: float | None = None) -> _core.Observation:
        """Waits for the next observation in sequence; see `Frontend.wait_for_next`.

        A cancelled task loses no observation. Tasks that each need every observation need one
        stream each.
        """
        frontend = self._frontend
        awaited = frontend._next
        if frontend.published < awaited:
            await in_thread(lambda: frontend._await_row(awaited, timeout))
        return frontend.wait_for_next(timeout)

    async def pulse_and_wait(
        self,
        timeout: float | None = None,
        *,
        at: int | None = None,
        late: LateWord = "reject",
        seen: _core.Observation | _core.Seen | None = None,
        check: bool = True,
    ) -> _core.Observation:
        """Sends all that was added and waits until it has ended; see `Frontend.pulse_and_wait`."""
        frontend = self._frontend
        try:
            if frontend._is_inline:  # iterations of an inline robot run in the calling thread
                return await in_thread(
                    lambda: frontend.pulse_and_wait(
                        timeout, at=at, late=late, seen=seen, check=check
                    )
                )
            batch = frontend._pulse_to_end(at, late, seen)
            return await in_thread(lambda: frontend._wait_for_end(batch, timeout, check))
        except asyncio.CancelledError:
            if not frontend.closed:
                frontend._purge_on_error()
            raise

    async def move_to(
        self,
        actuators: SupportsIndex | str | Sequence[SupportsIndex | str] | None,
        targets: Any,
        *,
        tolerance: "Tolerance",
        timeout: float | None = None,
        duration: float | None = None,
        speed: float | None = None,
        until: int | None = None,
        iterations: int | None = None,
        fastest: bool = False,
        mode: ModeWord = "queue",
        profile: ProfileWord | None = None,
        start: StartWord = "desired",
    ) -> _core.Observation:
        """Moves the robot to targets and waits until it reaches them; see `Frontend.move_to`."""
        frontend = self._frontend
        options = _core.CommandOptions(
            duration=duration,
            speed=speed,
            until=until,
            iterations=iterations,
            fastest=fastest,
            mode=mode,
            profile=profile,
            start=start,
        )

        def start_move() -> _core.Move:
            return frontend._start_move(actuators, targets, tolerance, timeout, options)

        move = await in_thread(start_move) if frontend._is_inline else start_move()
        return await in_thread(lambda: frontend._wait_for_move(move, timeout))

    async def burst(
        self,
        iterations: int = 1,
        *,
        timeout: float | None = None,
        at: int | None = None,
        late: LateWord = "reject",
        seen: _core.Observation | _core.Seen | None = None,
    ) -> _core.Observation:
        """Sends all added commands and bursts; see `Frontend.burst`."""
        frontend = self._frontend
        if frontend._is_inline:
            return await in_thread(
                lambda: frontend.burst(iterations, timeout=timeout, at=at, late=late, seen=seen)
            )
        burst = frontend.burst(iterations, wait=False, at=at, late=late, seen=seen)
        try:
            return await in_thread(lambda: burst.wait(timeout))
        except BaseException:
            burst.cancel()
            raise

    async def request(
        self,
        name: str,
        /,
        *,
        timeout: float | None = None,
        seen: _core.Observation | _core.Seen | None = None,
        **fields: Any,
    ) -> None:
        """Sends a request at once and waits for its end; see `Frontend.request`."""
        frontend = self._frontend
        if frontend._is_inline:
            await in_thread(lambda: frontend.request(name, timeout=timeout, seen=seen, **fields))
            return
        batch = frontend._send_request(name, fields, seen)
        await in_thread(lambda: frontend._wait_for_answer(name, batch, timeout))

    async def resume(
        self,
        number: int | None = None,
        *,
        timeout: float | None = 5.0,
        accept_reading: bool = False,
    ) -> bool:
        """Ends a halt; see `Frontend.resume`."""
        return await in_thread(
            lambda: self._frontend.resume(number, timeout=timeout, accept_reading=accept_reading)
        )
