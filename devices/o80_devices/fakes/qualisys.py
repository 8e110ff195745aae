"""A fake Qualisys Track Manager that streams moving bodies, with faults.

python -m o80_devices.fakes.qualisys --bodies racket,table --lose 0.1 --silent-every 10
"""

from __future__ import annotations

import argparse
import contextlib
import math
import random
import socket
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from threading import Event, Lock, Thread

from o80_devices.motion_capture.qualisys_packets import (
    BODY,
    GREETING,
    PORT,
    VERSION,
    Packets,
    Type,
    data_packet,
    words_of,
)

HIDDEN = BODY.pack(*[math.nan] * 13)


@dataclass
class Faults:
    """What goes wrong; may be changed while the server runs."""

    lose: float = 0.0  #: share of the frames that are not sent
    silent: bool = False  #: connected, but nothing comes: a pulled cable
    hidden: set[str] = field(default_factory=set)  #: bodies that no camera sees
    draw: random.Random = field(default_factory=lambda: random.Random(0))


class FakeQualisys:
    """Serves the RT protocol: bodies on circles of 0.1 m around (0, 0, number) [m], turning.

    A context manager. `restart` closes all connections and begins frames and stamps anew.
    """

    def __init__(
        self,
        bodies: Sequence[str] = ("racket", "table"),
        *,
        frequency: float = 300.0,
        host: str = "127.0.0.1",
        port: int = 0,
    ) -> None:
        """port 0: a free one."""
        self.bodies = list(bodies)
        self.frequency = frequency
        self.faults = Faults()
        self.frames_sent = 0
        self._listener = socket.create_server((host, port))
        self._listener.settimeout(0.05)
        self.port: int = self._listener.getsockname()[1]
        self._connected: list[socket.socket] = []
        self._lock = Lock()
        self._stopping = Event()
        self._begin = time.monotonic()
        self._threads = [Thread(target=self._accept, daemon=True)]

    def __enter__(self) -> FakeQualisys:
        self._threads[0].start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        self._hang_up()
        for thread in self._threads:
            thread.join(2.0)
        self._listener.close()

    def restart(self) -> None:
        self._begin = time.monotonic()
        self._hang_up()

    def _hang_up(self) -> None:
        with self._lock:
            for each in self._connected:
                with contextlib.suppress(OSError):  # the client was faster
                    each.shutdown(socket.SHUT_RDWR)
                each.close()
            self._connected.clear()

    # ------------------------------------------------------------------ the protocol

    def _accept(self) -> None:
        while not self._stopping.is_set():
            try:
                connected, _ = self._listener.accept()
            except TimeoutError:
                continue
            with self._lock:
                self._connected.append(connected)
            thread = Thread(target=self._serve, args=(connected,), daemon=True)
            self._threads.append(thread)
            thread.start()

    def _serve(self, connected: socket.socket) -> None:
        packets = Packets(connected)
        streams = False
        number = 0
        with connected, contextlib.suppress(OSError, ValueError):  # the client is gone
            if not self.faults.silent:
                packets.send(Type.COMMAND, GREETING)
            while not self._stopping.is_set():
                found = packets.receive(0.5 / self.frequency if streams else 0.05)
                if found is not None and not self.faults.silent:
                    streams |= self._answer(packets, words_of(found[1]))
                if streams:
                    number = self._send_due(connected, number)

    def _answer(self, packets: Packets, command: str) -> bool:
        """Answers a command; True for one that begins to stream."""
        command = command.lower()
        if command == f"version {VERSION}":
            packets.send(Type.COMMAND, f"Version set to {VERSION}")
        elif command.startswith("getparameters"):
            packets.send(Type.XML, self._settings())
        elif command == "streamframes allframes 6dres":
            return True
        else:
            packets.send(Type.ERROR, f"Parse error: {command}")
        return False

    def _settings(self) -> str:
        bodies = "".join(f"<Body><Name>{name}</Name></Body>" for name in self.bodies)
        root = f"QTM_Parameters_Ver_{VERSION}"
        return f"<{root}><The_6D><Bodies>{len(self.bodies)}</Bodies>{bodies}</The_6D></{root}>"

    def _send_due(self, connected: socket.socket, number: int) -> int:
        """Sends the frame of now if it was not sent; returns its number."""
        due = int((time.monotonic() - self._begin) * self.frequency)
        if due == number:
            return number
        faults = self.faults
        if not faults.silent and faults.draw.random() >= faults.lose:
            connected.sendall(self._frame(due))
            self.frames_sent += 1
        return due

    def _frame(self, number: int) -> bytes:
        now = number / self.frequency
        return data_packet(
            round(now * 1e6),
            number,
            [
                HIDDEN if name in self.faults.hidden else self._body(index, now)
                for index, name in enumerate(self.bodies)
            ],
        )

    def _body(self, index: int, now: float) -> bytes:
        c, s = math.cos(now), math.sin(now)
        columns = (c, s, 0.0, -s, c, 0.0, 0.0, 0.0, 1.0)
        return BODY.pack(100.0 * c, 100.0 * s, 1000.0 * index, *columns, 0.25)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m o80_devices.fakes.qualisys")
    parser.add_argument("--bodies", default="racket,table", help="names, separated by commas")
    parser.add_argument("--port", type=int, default=PORT)
    parser.add_argument("--frequency", type=float, default=300.0, help="[Hz]")
    parser.add_argument("--lose", type=float, default=0.0, help="share of the frames that are lost")
    parser.add_argument("--silent-every", type=float, default=0.0, help="[s]: silent for 2 s")
    parser.add_argument("--restart-every", type=float, default=0.0, help="[s]")
    given = parser.parse_args()
    with FakeQualisys(
        given.bodies.split(","), frequency=given.frequency, port=given.port
    ) as server:
        server.faults.lose = given.lose
        print(f"serving {given.bodies} on port {server.port}; Ctrl-C ends it", flush=True)
        begin = time.monotonic()
        restarted = 0
        try:
            while True:
                time.sleep(0.05)
                now = time.monotonic() - begin
                every = given.silent_every
                server.faults.silent = bool(every) and now > every and now % every < 2.0
                if given.restart_every and int(now / given.restart_every) > restarted:
                    restarted += 1
                    server.restart()
        except KeyboardInterrupt:
            print("ended")


if __name__ == "__main__":
    main()
