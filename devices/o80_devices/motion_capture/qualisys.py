"""Client of Qualisys Track Manager (QTM): poses with the server's time stamps and residuals."""

from __future__ import annotations

import socket
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from o80.base.descriptors import above_standard
from o80.drivers import option
from o80.errors import DriverError, InvalidArgument
from o80_devices.motion_capture.frame import Frame
from o80_devices.motion_capture.frame_stream import SILENCE, FrameStream
from o80_devices.motion_capture.qualisys_packets import (
    GREETING,
    PORT,
    VERSION,
    Packets,
    Type,
    parsed_data,
    words_of,
)
from o80_devices.motion_capture.sensor import Sensor, SensorConfig

ANSWER = 1.0  # timeout of an answer of the server [s]
TICK = 1000.0  # unit of the server's time stamps [ns]


class QualisysConnection:
    """Connection that streams the poses of all bodies."""

    patience = SILENCE

    def __init__(self, host: str, port: int) -> None:
        """Connects. Raises OSError or ValueError if the server does not answer as expected."""
        with above_standard():
            self._packets = Packets(socket.create_connection((host, port), ANSWER))
        try:
            self._expect(Type.COMMAND, GREETING)
            self._packets.send(Type.COMMAND, f"Version {VERSION}")
            self._expect(Type.COMMAND, "Version set")
            self._packets.send(Type.COMMAND, "GetParameters 6D")
            self.names = body_names(self._expect(Type.XML, ""))
            self._packets.send(Type.COMMAND, "StreamFrames AllFrames 6DRes")
        except BaseException:
            self._packets.close()
            raise

    def receive(self, timeout: float) -> Frame | None:
        found = self._packets.receive(timeout)
        if found is None:
            return None
        arrival = time.monotonic_ns()
        kind, content = found
        if kind == Type.ERROR:
            raise ValueError(f"the server says: {words_of(content)}")
        if kind != Type.DATA:
            return None  # an event, or no measurement
        stamp, number, bodies = parsed_data(content)
        if len(bodies) != len(self.names):
            # bodies were added or removed: requests their order again
            raise ValueError(f"a frame has {len(bodies)} bodies, the settings {len(self.names)}")
        return Frame(number, stamp, arrival, dict(zip(self.names, bodies, strict=True)))

    def close(self) -> None:
        self._packets.close()

    def _expect(self, kind: Type, begin: str) -> str:
        end = time.monotonic() + ANSWER
        while (left := end - time.monotonic()) > 0:
            found = self._packets.receive(left)
            if found is None:
                break
            answer = words_of(found[1])
            if found[0] == Type.ERROR:
                raise ValueError(f"the server says: {answer}")
            if found[0] == kind and answer.startswith(begin):
                return answer
        raise TimeoutError(f"the server has not answered within {ANSWER:g} s")


def body_names(settings: str) -> list[str]:
    """Reads the body names from 6D settings, in frame order. Raises ValueError for invalid XML."""
    try:
        root = ElementTree.fromstring(settings.strip())
    except ElementTree.ParseError as error:
        raise ValueError(f"the server's settings are not XML: {error}") from error
    return [(body.findtext("Name") or "").strip() for body in root.findall("The_6D/Body")]


class QualisysFrames(FrameStream):
    """Frames of a QTM server."""

    tick = TICK

    def __init__(self, host: str, port: int) -> None:
        super().__init__(lambda: QualisysConnection(host, port), f"Qualisys at {host}:{port}")
        self._host = host
        self._port = port

    @cached_property
    def names(self) -> Sequence[str]:
        """Body names of the server. Raises DriverError if the server does not report them."""
        try:
            connection = QualisysConnection(self._host, self._port)
        except (OSError, ValueError) as error:
            raise DriverError(
                f"Qualisys Track Manager at {self._host}:{self._port} does not list its bodies: "
                f"{error}. Start it, correct --host and --port, or name the bodies with --subjects"
            ) from error
        connection.close()
        return connection.names


class Qualisys(Sensor):
    """Driver of Qualisys: `o80 run o80_devices.motion_capture:Qualisys --host 10.0.0.2`."""

    name = "motion_capture"

    @dataclass
    class Config(SensorConfig):
        host: str = option("127.0.0.1", "of Qualisys Track Manager")
        port: int = option(PORT, "little endian")

    def __init__(self, config: Config) -> None:
        if not 0 < config.port < 1 << 16:
            raise InvalidArgument(f"port must be between 1 and 65535, got {config.port}")
        super().__init__(config, QualisysFrames(config.host, config.port))
