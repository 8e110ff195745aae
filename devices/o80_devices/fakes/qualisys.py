"""Fake Qualisys Track Manager that streams moving bodies, with faults.

python -m o80_devices.fakes.qualisys --bodies racket,table --lose 0.1 --silent-every 10
"""

import contextlib
import math
import random
import re
import socket
import struct
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from threading import Event, Lock, Thread

from o80.base.screen import keep_printing
from o80_devices.fakes import numbers
from o80_devices.motion_capture.qualisys_packets import (
    GREETING,
    PORT,
    VERSION,
    Packets,
    Type,
    data_packet,
    packet,
    words_of,
)

RESIDUAL = 0.25  # [mm]
CONNECTED = b"\x01"
"""Event that reports the state of the server."""
COMPONENTS = {
    **{"3d": 1, "3dnolabels": 2, "3dres": 9, "3dnolabelsres": 10},  # the fake has no markers
    **{"6d": 5, "6deuler": 6, "6dres": 11, "6deulerres": 12},
}
ANSWERS = {  # answers to commands without an effect
    "qtmversion": "QTM Version is 2.17 (build 4000)",
    "byteorder": "Byte order is little endian",
    "takecontrol": "You are now master",
    "releasecontrol": "You are now a regular client",
    "new": "Creating new connection",
    "close": "Closing connection",
    "start": "Starting measurement",
    "stop": "Stopping measurement",
    "load": "Measurement loaded",
    "save": "Measurement saved",
    "loadproject": "Project loaded",
    "trig": "Trig ok",
    "event": "Event set",
}
Pose = tuple[Sequence[float], Sequence[float]]
"""Position [m], and the nine numbers of the rotation, row by row."""


@dataclass(frozen=True)
class Stream:
    """Stream of frames that a client has requested."""

    send: Callable[[bytes], object]
    components: Sequence[str]
    every: int  # frames


@dataclass
class Faults:
    """Faults of the server; may be changed at run time."""

    lose: float = 0.0  #: share of the frames that are not sent
    silent: bool = False  #: connected, but nothing is sent, as with a pulled cable
    hidden: set[str] = field(default_factory=set)  #: bodies that no camera sees
    draw: random.Random = field(default_factory=lambda: random.Random(0))


class FakeQualisys:
    """Serves the RT protocol: all commands of the vendor's client but settings and calibrations.

    Bodies turn on circles of 0.1 m around (0, 0, number) [m].
    poses: other pose of a body, by name and monotonic time [ns]; None: not seen.
    A context manager. `restart` closes all connections and restarts frame numbers and stamps.
    """

    def __init__(
        self,
        bodies: Sequence[str] = ("racket", "table"),
        *,
        frequency: float = 300.0,
        host: str = "127.0.0.1",
        port: int = 0,
        poses: Callable[[str, int], Pose | None] | None = None,
    ) -> None:
        """port: 0 takes any free one."""
        self.bodies = list(bodies)
        self.frequency = frequency
        self.faults = Faults()
        self.frames_sent = 0
        self._poses = poses
        self._listener = socket.create_server((host, port))
        self._listener.settimeout(0.05)
        self._datagrams = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.port: int = self._listener.getsockname()[1]
        self._connected: list[socket.socket] = []
        self._lock = Lock()
        self._stopping = Event()
        self._begin = time.monotonic()
        self._threads = [Thread(target=self._accept, daemon=True)]

    def __enter__(self) -> "FakeQualisys":
        self._threads[0].start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        self._close_connections()
        for thread in self._threads:
            thread.join(2.0)
        self._listener.close()
        self._datagrams.close()

    def restart(self) -> None:
        self._begin = time.monotonic()
        self._close_connections()

    def _close_connections(self) -> None:
        with self._lock:
            for each in self._connected:
                with contextlib.suppress(OSError):  # the client closed first
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
        stream: Stream | None = None
        number = 0
        with connected, contextlib.suppress(OSError, ValueError):  # the client has disconnected
            if not self.faults.silent:
                packets.send(Type.COMMAND, GREETING)
            while not self._stopping.is_set():
                if stream is not None:
                    self._wait_for(number + 1)
                    number = self._send_due(stream, number)
                found = packets.receive(0.05 if stream is None else 0.0)
                if found is None or self.faults.silent:
                    continue
                verb, *words = words_of(found[1]).lower().split() or [""]
                if verb == "streamframes":
                    stream = self._stream(connected, words)
                    if stream is not None or words == ["stop"]:
                        continue
                self._answer(packets, connected, verb, words)

    def _stream(self, connected: socket.socket, words: list[str]) -> Stream | None:
        """Parses the words of `streamframes`; None for a stop or an invalid request."""
        found = re.fullmatch(
            r"(allframes|frequency:(\d+)|frequencydivisor:(\d+))( udp:(\d+))?(.*)", " ".join(words)
        )
        if found is None or not set(found[6].split()) <= set(COMPONENTS):
            return None
        every = max(1, round(self.frequency / int(found[2])) if found[2] else int(found[3] or 1))
        components = found[6].split()
        if not found[5]:
            return Stream(connected.sendall, components, every)
        there = connected.getpeername()[0], int(found[5])
        return Stream(lambda content: self._datagrams.sendto(content, there), components, every)

    def _answer(
        self, packets: Packets, connected: socket.socket, verb: str, words: list[str]
    ) -> None:
        if verb == "version":
            packets.send(Type.COMMAND, f"Version set to {' '.join(words)}")
        elif verb in ANSWERS:
            packets.send(Type.COMMAND, ANSWERS[verb])
        elif verb == "getstate":
            connected.sendall(packet(Type.EVENT, CONNECTED))
        elif verb == "getparameters":
            packets.send(Type.XML, self._settings())
        elif verb == "getcurrentframe" and set(words) <= set(COMPONENTS):
            connected.sendall(self._frame(self._due(), words))
        else:
            packets.send(Type.ERROR, f"Parse error: {' '.join([verb, *words])}")

    def _settings(self) -> str:
        bodies = "".join(
            f"<Body><Name>{name}</Name><RGBColor>255</RGBColor>"
            "<Point><X>0</X><Y>0</Y><Z>0</Z></Point></Body>"
            for name in self.bodies
        )
        angles = "<Euler><First>Roll</First><Second>Pitch</Second><Third>Yaw</Third></Euler>"
        settings = f"<The_6D><Bodies>{len(self.bodies)}</Bodies>{bodies}{angles}</The_6D>"
        root = f"QTM_Parameters_Ver_{VERSION}"
        return f"<{root}>{settings}</{root}>"

    def _wait_for(self, number: int) -> None:
        """Waits until a frame is due; socket timeouts are too coarse."""
        left = self._begin + number / self.frequency - time.monotonic()
        if left > 0.0:
            self._stopping.wait(min(left, 1.0 / self.frequency))

    def _due(self) -> int:
        """Number of the frame that is due now."""
        return int((time.monotonic() - self._begin) * self.frequency)

    def _send_due(self, stream: Stream, number: int) -> int:
        """Sends the due frame unless `number` is that frame; returns the due number."""
        due = self._due() // stream.every * stream.every
        if due == number:
            return number
        faults = self.faults
        if not faults.silent and faults.draw.random() >= faults.lose:
            stream.send(self._frame(due, stream.components))
            self.frames_sent += 1
        return due

    def _frame(self, number: int, components: Sequence[str]) -> bytes:
        now = number / self.frequency
        poses = [
            None if name in self.faults.hidden else self._pose(index, now)
            for index, name in enumerate(self.bodies)
        ]
        listed = {
            COMPONENTS[name]: [packed(pose, name) for pose in poses] if name[0] == "6" else []
            for name in components
        }
        return data_packet(round(now * 1e6), number, listed)

    def _pose(self, index: int, now: float) -> Pose | None:
        if self._poses is not None:
            return self._poses(self.bodies[index], round((self._begin + now) * 1e9))
        c, s = math.cos(now), math.sin(now)
        return (0.1 * c, 0.1 * s, 1.0 * index), (c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)


def packed(pose: Pose | None, component: str) -> bytes:
    """Packs a pose in millimetres and degrees; NaN: not seen."""
    (x, y, z), rows = pose or (3 * (math.nan,), 9 * (math.nan,))
    if "euler" in component:  # roll about x, then pitch and yaw about the new axes
        pitch = math.asin(min(max(rows[2], -1.0), 1.0))
        angles = math.atan2(-rows[5], rows[8]), pitch, math.atan2(-rows[1], rows[0])
        rotation = [math.degrees(each) for each in angles]
    else:
        rotation = [rows[3 * i + j] for j in range(3) for i in range(3)]  # column by column
    residual = [RESIDUAL if pose else math.nan] if component.endswith("res") else []
    numbers = (1000.0 * x, 1000.0 * y, 1000.0 * z, *rotation, *residual)
    return struct.pack(f"<{len(numbers)}f", *numbers)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = numbers.parser(
        "qualisys",
        bodies=(str, "racket,table", "names, separated by commas"),
        port=(numbers.port, PORT, "little endian"),
        frequency=(numbers.positive, 300.0, "[Hz]"),
        lose=(numbers.share, 0.0, "share of the frames that are lost"),
        silent_every=(numbers.not_negative, 0.0, "[s]: silent for 2 s"),
        restart_every=(numbers.not_negative, 0.0, "[s]"),
    )
    given = parser.parse_args(arguments)
    try:
        made = FakeQualisys(given.bodies.split(","), frequency=given.frequency, port=given.port)
    except OSError as error:
        parser.error(f"port {given.port} cannot be used: {error.strerror}")
    with made as server:
        server.faults.lose = given.lose
        print(f"serving {given.bodies} on port {server.port}; Ctrl-C ends it", flush=True)
        begin = time.monotonic()
        restarted = 0
        try:
            while True:
                time.sleep(0.05)
                now, every = time.monotonic() - begin, given.silent_every
                server.faults.silent = bool(every) and now > every and now % every < 2.0
                if given.restart_every and int(now / given.restart_every) > restarted:
                    restarted += 1
                    server.restart()
        except KeyboardInterrupt:
            print("ended")


if __name__ == "__main__":
    keep_printing()
    main()
