"""Protocol of the launcher as a state machine that the caller steps; no call blocks.

One exchange runs at a time. A launch is sent at most once, and only after the launcher has
confirmed the state. If the outcome of a launch is unknown, the next launch waits for the longest
duration of a launch, and then for two confirmed states. One confirmation does not suffice: the
server serves several connections in turn, and only its second reply proves that no older request
is queued. New states are sent during that wait, too, because a halt must stop the
motors.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

from o80.errors import RequestRejected
from o80_devices.ball_launcher.exchange import Exchange, Outcome
from o80_devices.ball_launcher.messages import Kind, Request, State

SECOND = 1_000_000_000  # [ns]
CONFIRMATIONS = 2  # confirmed states after which no older request can be queued


class Status(IntEnum):
    """State of the launcher, or the reason why it cannot launch."""

    disconnected = 0
    setting = 1
    """The state was sent and is not confirmed yet."""
    ready = 2
    launching = 3
    unknown = 4
    """A launch was not answered: it may still be under way."""
    refused = 5
    """The launcher has refused the state, which is sent again."""


class LastLaunch(IntEnum):
    """Outcome of the last launch."""

    none = 0
    completed = 1
    rejected = 2
    """Refused by the launcher, for example because it has no ball."""
    not_sent = 3
    timed_out = 4
    """Sent and not answered: a ball may have been launched."""


@dataclass(frozen=True)
class Timing:
    """Timeouts and intervals [ns]."""

    deliver: int = SECOND // 2
    """Timeout of the connection for a request."""
    state: int = 5 * SECOND
    """Timeout of a change of state."""
    launch: int = 15 * SECOND
    """Longest duration of a launch."""
    retry: int = SECOND
    """Interval between attempts to set a state that was refused or not answered."""


class Launcher:
    """Keeps the launcher in the wanted state, and launches on request."""

    def __init__(
        self, exchange: Callable[[Request, int, int], Exchange], timing: Timing = Timing()
    ) -> None:
        """exchange: opens an exchange. Arguments: deadline of the connection, timeout [ns]."""
        self._open = exchange
        self._timing = timing
        self._exchange: Exchange | None = None
        self._kind = Kind.SET_STATE
        self._sending = self._wanted = State()
        self._confirmed: State | None = None
        self._to_confirm = CONFIRMATIONS
        self._connected = self._began_unknown = False
        self._requested = False
        self._frozen: State | None = None  # the wanted state when the launch was sent
        self._retry_at = self._unknown_until = 0
        self._refused: State | None = None
        self._end: tuple[LastLaunch, str] | None = None
        self.last_launch = LastLaunch.none
        self.counts = dict.fromkeys(LastLaunch, 0)
        self.launched_at = 0
        """Time at which the last launch was confirmed [ns]."""

    # ------------------------------------------------------------------ what is known

    def status(self, now: int) -> Status:
        if self._exchange is not None and self._kind is Kind.LAUNCH_BALL:
            return Status.launching
        if now < self._unknown_until:
            return Status.unknown
        if not self._connected:
            return Status.disconnected
        if self._refused is not None:
            return Status.refused
        is_set = self._is_confirmed() and self._confirmed == self._wanted
        return Status.ready if is_set else Status.setting

    @property
    def confirmed(self) -> State | None:
        """Confirmed state of the launcher; None: unknown."""
        return self._confirmed if self._connected else None

    def unknown_for(self, now: int) -> int:
        """Time until the next launch may be sent [ns]."""
        return max(0, self._unknown_until - now)

    def _is_confirmed(self) -> bool:
        return self._confirmed is not None and self._to_confirm == 0

    # ------------------------------------------------------------------ launches

    def ask(self, now: int) -> None:
        """Requests a launch. Raises RequestRejected if a launch is impossible now."""
        status = self.status(now)
        if self._requested or status is Status.launching:
            raise RequestRejected("a launch is under way: wait until it has ended")
        if status is Status.disconnected:
            raise RequestRejected("the launcher is not connected: check its power and address")
        if status is Status.unknown:
            raise RequestRejected(
                "a launch was not answered and may still be under way: no launch for "
                f"{self.unknown_for(now) / SECOND:.1f} s"
            )
        if status is Status.refused:
            raise RequestRejected("the launcher has refused the desired state: change it")
        self._requested, self._frozen, self._end = True, None, None

    def cancel(self) -> None:
        """Cancels a launch that was not sent yet; a launch that was sent continues."""
        launching = self._exchange is not None and self._kind is Kind.LAUNCH_BALL
        self._requested = self._requested and launching

    def ended(self) -> tuple[LastLaunch, str] | None:
        """Returns the outcome of the requested launch, once; None: it has not ended."""
        end, self._end = self._end, None
        return end

    def _end_launch(self, how: LastLaunch, why: str = "") -> None:
        self._requested, self._end = False, (how, why)
        self.last_launch = how
        self.counts[how] += 1

    # ------------------------------------------------------------------ a step

    def step(self, now: int, connected: bool, wanted: State) -> None:
        """Polls the open exchange, and begins the next one when it has ended. now: [ns]"""
        if not connected:
            self._forget_state()
        self._connected, self._wanted = connected, wanted.rounded()
        if self._exchange is not None:
            outcome = self._exchange.poll(now)
            if outcome is Outcome.pending:
                return
            self._exchange = None
            take = self._take_launch if self._kind is Kind.LAUNCH_BALL else self._take_state
            take(outcome, now)
        self._begin(now, self._wanted)

    @property
    def may_hold_older_requests(self) -> bool:
        """Whether the launcher may execute an older request after it has replied to a newer one."""
        is_sent = self._exchange is not None and self._exchange.sent
        return is_sent or self._to_confirm == CONFIRMATIONS

    def close(self) -> None:
        """Closes the open exchange."""
        if self._exchange is not None:
            self._exchange.close()
            self._exchange = None

    def _forget_state(self) -> None:
        self._confirmed = self._refused = None
        self._to_confirm = max(self._to_confirm, 1)

    def _begin(self, now: int, wanted: State) -> None:
        if not self._connected:
            if self._requested:
                why = "the launcher was disconnected before the launch was sent"
                self._end_launch(LastLaunch.not_sent, why)
            return
        if self._requested:
            self._frozen = wanted = self._frozen or wanted
        if self._refused is not None and self._refused != wanted:
            self._refused, self._retry_at = None, now
        unknown = now < self._unknown_until
        if self._confirmed != wanted or not (unknown or self._is_confirmed()):
            if now >= self._retry_at:
                self._sending = wanted
                self._send(Kind.SET_STATE, now)
        elif self._requested and not unknown:
            self._send(Kind.LAUNCH_BALL, now)

    def _send(self, kind: Kind, now: int) -> None:
        wait = self._timing.launch if kind is Kind.LAUNCH_BALL else self._timing.state
        request = Request(kind, self._sending if kind is Kind.SET_STATE else None)
        self._kind = kind
        self._began_unknown = now < self._unknown_until
        self._exchange = self._open(request, now + self._timing.deliver, wait)

    def _take_state(self, outcome: Outcome, now: int) -> None:
        if outcome is Outcome.done and self._connected:
            self._confirmed, self._refused = self._sending, None
            if not self._began_unknown:
                self._to_confirm = max(0, self._to_confirm - 1)
            return
        self._confirmed = None
        unanswered = outcome is Outcome.unanswered
        self._to_confirm = CONFIRMATIONS if unanswered else max(1, self._to_confirm)
        self._refused = self._sending if outcome is Outcome.refused else None
        self._retry_at = now + self._timing.retry
        if self._requested:
            why = f"nothing was launched: the launcher's state was {outcome.value}"
            self._end_launch(LastLaunch.not_sent, why)

    def _take_launch(self, outcome: Outcome, now: int) -> None:
        if outcome is Outcome.done:
            self.launched_at = now
            self._end_launch(LastLaunch.completed)
        elif outcome is Outcome.refused:
            self._end_launch(LastLaunch.rejected, "the launcher refused: is its magazine empty?")
        elif outcome is Outcome.not_delivered:
            why = "the launch was not delivered, and will not be sent later"
            self._end_launch(LastLaunch.not_sent, why)
            self._forget_state()
        else:
            self._unknown_until = now + self._timing.launch
            self._confirmed, self._to_confirm = None, CONFIRMATIONS
            seconds = self._timing.launch / SECOND
            why = f"timed out: the launch may still be under way; no other for {seconds:g} s"
            self._end_launch(LastLaunch.timed_out, why)
