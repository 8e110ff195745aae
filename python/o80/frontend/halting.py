"""How a frontend halts its backend and resumes it."""

from typing import TYPE_CHECKING

from o80.checked import whole
from o80.frontend.controlling import Controlling
from o80.halts import Halt


class Halting(Controlling):
    """The part of o80.Frontend that halts, resumes and shows life."""

    if TYPE_CHECKING:

        def halt(self, reason: str = "") -> int:
            """Halts the backend: commands end as halted, actuators brake within their limits.

            Nothing moves again until `resume`. Acts in the first iteration begun after it, whoever
            has control. Returns the number of the halt. Raises ReadOnly, BackendGone.
            """

        def keep_alive(self) -> None:
            """Tells the backend's watchdog that this frontend lives.

            A pulse and a wait for one's own batch do so too; reading does not.
            """

    @property
    def halted(self) -> Halt | None:
        """The halt that acts, or None. Asked for a moment ago, its iteration is None."""
        fields = self._halted
        if fields is None:
            return None
        number, cause, iteration, who, text = fields
        return Halt(number, cause, None if iteration < 0 else iteration, who, text)

    def resume(self, number: int | None = None, *, timeout: float | None = 5.0) -> None:
        """Ends a halt: the robot starts afresh from where it is, with nothing queued.

        number: of the halt that was looked at (None: the one that acts now). A halt that came after
            it stands.
        timeout: for the halt to act, the robot to come to rest, and the backend's answer [s].

        Needs a lane, but no control. In bursting it does not wait for the robot to rest: burst
        until it does.

        Raises BackendHalted if it is refused: another halt came, the robot refuses, or it still
        brakes and bursts. Raises TimeoutError, NoLane, BackendGone.
        Does nothing if no halt acts.
        """
        if number is None:
            halt = self.halted
            if halt is None:
                return
            number = halt.number
        self._resume(whole(number, "the number of a halt", 1), timeout)
