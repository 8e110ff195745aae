"""The fake Qualisys server answers the vendor's own client, `qtm-rt`, in its own version."""

import asyncio
import math
import struct
from collections.abc import Awaitable, Callable, Iterator
from typing import Any, TypeVar

import pytest
import qtm_rt
from qtm_rt.packet import QRTComponentType

from o80_devices.fakes.qualisys import FakeQualisys

WAIT = 60.0  # [s] longer than anything here takes
POSE = ((1.0, -2.0, 0.5), (0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0))  # 90 degrees about z
COLUMNS = (0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0)
Found = TypeVar("Found")


@pytest.fixture
def server() -> Iterator[FakeQualisys]:
    with FakeQualisys(["racket"], frequency=200.0, poses=lambda *_: POSE) as served:
        yield served


def requested(server: FakeQualisys, question: Callable[[Any], Awaitable[Found]]) -> Found:
    """The answer that a connection of the vendor's client gets."""

    async def ask() -> Found:
        connection = await asyncio.wait_for(
            qtm_rt.connect("127.0.0.1", server.port, timeout=WAIT), WAIT
        )
        try:
            return await question(connection)
        finally:
            connection.disconnect()

    return asyncio.run(ask())


@pytest.mark.parametrize(
    ("component", "rotation", "residual"),
    [
        ("6d", COLUMNS, ()),
        ("6dres", COLUMNS, (0.25,)),
        ("6deuler", (0.0, 0.0, 90.0), ()),
        ("6deulerres", (0.0, 0.0, 90.0), (0.25,)),
    ],
)
def test_a_pose_is_the_same_in_every_form(
    server: FakeQualisys, component: str, rotation: tuple[float, ...], residual: tuple[float, ...]
) -> None:
    reader = {"6d": "get_6d", "6dres": "get_6d_residual", "6deuler": "get_6d_euler"}
    frame = requested(server, lambda client: client.get_current_frame([component, "3dnolabels"]))
    header, (body,) = getattr(frame, reader.get(component, "get_6d_euler_residual"))()
    assert header.body_count == 1
    position, turned, *rest = body
    assert position == (1000.0, -2000.0, 500.0)
    assert (turned[0] if len(turned) == 1 else turned) == pytest.approx(rotation)
    assert tuple(each.residual for each in rest) == residual
    assert frame.get_3d_markers_no_label()[1] == []

    server.faults.hidden = {"racket"}
    frame = requested(server, lambda client: client.get_current_frame([component]))
    (place,) = frame.components.values()
    numbers = struct.unpack_from(f"<{3 + len(rotation) + len(residual)}f", frame.data, place + 8)
    assert all(map(math.isnan, numbers))


@pytest.mark.parametrize(
    ("rate", "step"), [("allframes", 1), ("frequency:100", 2), ("frequencydivisor:4", 4)]
)
def test_frames_are_streamed_until_they_are_stopped(
    server: FakeQualisys, rate: str, step: int
) -> None:
    async def streamed(client: Any) -> list[Any]:
        packets: list[Any] = []
        enough = asyncio.Event()

        def take(packet: Any) -> None:
            packets.append(packet)
            if len(packets) == 5:
                enough.set()

        assert await client.stream_frames(rate, ["6dres"], take) == b"Ok"
        await asyncio.wait_for(enough.wait(), WAIT)
        await client.stream_frames_stop()
        await asyncio.wait_for(nothing_is_sent(), WAIT)
        return packets

    async def nothing_is_sent() -> None:
        """Waits for 20 frames of which none is streamed."""
        other = await qtm_rt.connect("127.0.0.1", server.port, timeout=WAIT)
        sent = -1
        while server.frames_sent != sent:
            sent = server.frames_sent
            begin = (await other.get_current_frame(["6d"])).framenumber
            while (await other.get_current_frame(["6d"])).framenumber < begin + 20:
                pass
        other.disconnect()

    packets = requested(server, streamed)
    for packet in packets:
        assert packet.framenumber % step == 0
        assert packet.timestamp == packet.framenumber * 5000
        assert list(packet.components) == [QRTComponentType.Component6dRes]


def test_state_version_and_settings_are_told(server: FakeQualisys) -> None:
    assert requested(server, lambda client: client.get_state()) == qtm_rt.QRTEvent.EventConnected
    assert requested(server, lambda client: client.qtm_version()).startswith(b"QTM Version is")
    order = requested(server, lambda client: client.byte_order())
    assert order == b"Byte order is little endian"
    settings = requested(server, lambda client: client.get_parameters(["6d"]))
    assert b"<Name>racket</Name>" in settings


@pytest.mark.parametrize(
    ("command", "arguments"),
    [
        *(("take_control", ["secret"]), ("release_control", []), ("new", []), ("close", [])),
        *(("start", []), ("start", [True]), ("stop", []), ("load", ["a.qtm"])),
        *(("save", ["a.qtm"]), ("load_project", ["a"]), ("trig", []), ("set_qtm_event", ["x"])),
    ],
)
def test_a_command_that_controls_is_answered(
    server: FakeQualisys, command: str, arguments: list[Any]
) -> None:
    """The client raises an exception for an answer that it does not expect."""
    requested(server, lambda client: getattr(client, command)(*arguments))


def test_what_is_not_served_is_an_error(server: FakeQualisys) -> None:
    with pytest.raises(qtm_rt.QRTCommandException, match="Parse error"):
        requested(server, lambda client: client.get_current_frame(["analog"]))
