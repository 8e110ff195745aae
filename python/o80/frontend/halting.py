"""How a frontend halts its backend and resumes it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from o80.base.argument_checks import whole
from o80.frontend.controlling import Controlling

if TYPE_CHECKING:
    from o80.frontend.halts import Halt


class Halting(Controlling):
    """The part of o80.Frontend that halts, resumes and gives signs of life."""

    if TYPE_CHECKING:

        def halt(self, reason: str = "") -> int:
            """Halts the backend: commands end as halted, actuators brake within their limits.

            Nothing moves again until `resume`. In force from the first iteration begun after it;
            needs no control. Returns the number of the halt. Raises ReadOnly, BackendGone.
            """

        def keep_alive(self) -> None:
            """Gives the backend's watchdog a sign of life.

            A pulse and a wait for a batch of this frontend do so too; reading does not.
            """

    @property
    def halted(self) -> Halt | None:
        """The halt in force, or requested (its iteration is then None); None if there is none."""
        fields = self._halted
        if fields is None:
            return None
        from o80.frontend.halts import Halt

        number, cause, iteration, who, text = fields
        return Halt(number, cause, None if iteration < 0 else iteration, who, text)

    def resume(
        self,
        number: int | None = None,
        *,
        timeout: float | None = 5.0,
        accept_reading: bool = False,
    ) -> bool:
        """Ends a halt: the robot makes a fresh start at its present position, with empty queues.

        number: number of the halt (None: the one in force now). A halt that came after it stays.
        timeout: how long to wait until the halt is in force, the robot is at rest, and the backend
            has answered [s].
        accept_reading: go on from where the robot is read to be, even if it cannot have come
            there since the halt.

        Needs a lane, but no control. In bursting mode it does not wait until the robot is at rest:
        burst until it is.

        Raises BackendHalted if it is refused: another halt came after it, the robot refuses, it
        cannot be where it is read, or, in bursting mode, it still brakes. Raises
        TimeoutError, NoLane, BackendGone.
        Returns True if it ended a halt, False if there was none.
        """
        if number is None:
            halt = self.halted
            if halt is None:
                return False
            number = halt.number
        return self._resume(whole(number, "the number of a halt", 1), timeout, accept_reading)
