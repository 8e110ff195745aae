"""Detects whether the launcher is connected, over a separate connection for heartbeats."""

from __future__ import annotations

from typing import Any

from o80.errors import DriverError

RECONNECT = 50  # [ms]


class Link:
    """Monitors the connection. Missing heartbeats reveal a pulled cable."""

    def __init__(self, zmq: Any, context: Any, address: str, timeout: float) -> None:
        """timeout: longest heartbeat gap [s]; 0: no heartbeats, for servers older than ZMTP 3.1."""
        self._zmq = zmq
        self._up = False
        self._socket = context.socket(zmq.REQ)
        self._socket.setsockopt(zmq.LINGER, 0)
        self._socket.setsockopt(zmq.RECONNECT_IVL, RECONNECT)
        if timeout > 0:
            interval = max(1, round(1000 * timeout / 4))
            self._socket.setsockopt(zmq.HEARTBEAT_IVL, interval)
            self._socket.setsockopt(zmq.HEARTBEAT_TIMEOUT, round(1000 * timeout) - interval)
            self._socket.setsockopt(zmq.CONNECT_TIMEOUT, 1000)
        events = zmq.EVENT_HANDSHAKE_SUCCEEDED | zmq.EVENT_DISCONNECTED
        self._monitor = self._socket.get_monitor_socket(events)
        try:
            self._socket.connect(address)
        except zmq.ZMQError as error:
            self.close()
            raise DriverError(
                f"address '{address}' cannot be used ({error}): give one such as "
                "tcp://192.168.0.5:5555"
            ) from None

    def is_up(self) -> bool:
        """Whether the launcher has been connected without a break since the last call.

        A launcher that restarted between two calls has lost its state: one call must then return
        False although the connection is up again.
        """
        from zmq.utils.monitor import recv_monitor_message

        was_lost = False
        while self._monitor.poll(0):
            event = recv_monitor_message(self._monitor, self._zmq.NOBLOCK)["event"]
            self._up = event == self._zmq.EVENT_HANDSHAKE_SUCCEEDED
            was_lost = was_lost or not self._up
        return self._up and not was_lost

    def close(self) -> None:
        self._socket.disable_monitor()
        self._monitor.close(linger=0)
        self._socket.close(linger=0)
