"""One request to the launcher and its reply, on a socket of its own, without ever blocking."""

from __future__ import annotations

from enum import Enum
from typing import Any

from o80.base.descriptors import above_standard
from o80_devices.ball_launcher.messages import DONE, REFUSED, Request

DELIVERED_WITHIN = 1000
"""Timeout after which the kernel drops bytes that were not acknowledged [ms]."""


class Outcome(Enum):
    """State of an exchange."""

    pending = "pending"
    done = "done"
    refused = "refused"
    not_delivered = "not delivered"
    """The request was not sent, and never will be."""
    unanswered = "unanswered"
    """The request was sent and not answered: it may still be executed."""


class Exchange:
    """Sends one request at most once.

    A ZeroMQ socket of the usual kind keeps a request for a launcher that appears later. This one
    accepts a request only with a connection (IMMEDIATE), never reconnects, drops unsent bytes when
    closed (LINGER), and stops the kernel from delivering them after a pulled cable is back
    (TCP_MAXRT). It serves one exchange.
    """

    @above_standard()
    def __init__(
        self, zmq: Any, context: Any, address: str, request: Request, deliver_by: int, wait: int
    ) -> None:
        """deliver_by: deadline of the connection [ns]. wait: timeout of the reply [ns]."""
        self._zmq = zmq
        self._content = request.encoded()
        self._deliver_by, self._wait = deliver_by, wait
        self._answer_by: int | None = None
        self._socket = context.socket(zmq.REQ)
        self._socket.setsockopt(zmq.LINGER, 0)
        self._socket.setsockopt(zmq.IMMEDIATE, 1)
        self._socket.setsockopt(zmq.RECONNECT_IVL, -1)
        self._socket.setsockopt(zmq.TCP_MAXRT, DELIVERED_WITHIN)
        self._monitor = self._socket.get_monitor_socket(zmq.EVENT_DISCONNECTED)
        self._socket.connect(address)
        self.outcome = Outcome.pending

    @property
    def sent(self) -> bool:
        return self._answer_by is not None

    def poll(self, now: int) -> Outcome:
        """Advances the exchange without blocking, and returns the outcome. now: [ns]"""
        if self.outcome is Outcome.pending:
            self.outcome = self._progress(now)
            if self.outcome is not Outcome.pending:
                self.close()
        return self.outcome

    def close(self) -> None:
        """Closes the socket; an unsent request is dropped."""
        if not self._socket.closed:
            self._socket.disable_monitor()
            self._monitor.close(linger=0)
            self._socket.close(linger=0)

    def _progress(self, now: int) -> Outcome:
        if self._answer_by is None and not self._send(now):
            return Outcome.pending if now < self._deliver_by else Outcome.not_delivered
        assert self._answer_by is not None
        lost = self._monitor.poll(0) > 0  # polled first: a reply may precede the loss
        try:
            reply = self._socket.recv(self._zmq.NOBLOCK)
        except self._zmq.Again:
            late = now >= self._answer_by
            return Outcome.unanswered if lost or late else Outcome.pending
        if reply in DONE:
            return Outcome.done
        return Outcome.refused if reply in REFUSED else Outcome.unanswered

    def _send(self, now: int) -> bool:
        try:
            self._socket.send(self._content, self._zmq.NOBLOCK)
        except self._zmq.Again:
            return False
        self._answer_by = now + self._wait
        return True
