"""Messages of damaged, wrong or hostile devices: no crash, no invalid pose, no stall."""

import math
import socket
import struct
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from device_rows import WAIT, answering, row_where
from hypothesis import example, given
from hypothesis import strategies as st

import o80
from o80_devices.ball_tracking.server_messages import (
    LARGEST_MESSAGE,
    Message,
    Options,
    ServerReason,
    ServerTrack,
)
from o80_devices.ball_tracking.tracking_server import TrackingServer
from o80_devices.fakes.qualisys import FakeQualisys
from o80_devices.fakes.tracking_server import FakeTrackingServer
from o80_devices.motion_capture.qualisys import Qualisys, QualisysConnection, body_names
from o80_devices.motion_capture.qualisys_packets import (
    BODIES,
    BODY,
    COMPONENT,
    DATA,
    GREETING,
    HEADER,
    SIX_D_WITH_RESIDUAL,
    Packets,
    Type,
    data_packet,
    parsed_data,
    text,
)
from o80_devices.motion_capture.sensor import Reason

UNTURNED = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


def data_of(*bodies: bytes) -> bytes:
    """Content of a packet with these bodies."""
    return data_packet(5, 7, {SIX_D_WITH_RESIDUAL: bodies})[HEADER.size :]


WHOLE = data_of(*3 * [BODY.pack(1.0, 2.0, 3.0, *UNTURNED, 0.1)])


# ---------------------------------------------------------------------- packets of Qualisys


@given(st.lists(st.tuples(st.integers(0, len(WHOLE) - 1), st.integers(0, 255)), max_size=8))
def test_a_damaged_packet_gives_poses_that_are_rotations_or_an_error(
    changes: list[tuple[int, int]],
) -> None:
    content = bytearray(WHOLE)
    for place, value in changes:
        content[place] = value
    try:
        _, _, bodies = parsed_data(bytes(content))
    except ValueError:
        return
    for body in bodies:
        if body.visible:
            assert all(map(math.isfinite, (*body.position, *body.quaternion)))
            assert math.isclose(sum(each**2 for each in body.quaternion), 1.0, rel_tol=1e-6)


@given(st.binary(max_size=400))
@example(b"\xff" * 400)
def test_noise_is_an_error_or_nothing(content: bytes) -> None:
    try:
        _, _, bodies = parsed_data(content)
    except ValueError:
        return
    assert len(bodies) < 10


@pytest.mark.parametrize(
    "rotation",
    [
        (0.0,) * 9,
        (1.0,) * 9,
        tuple(2 * each for each in UNTURNED),
        (-1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),  # a mirror
        (1e30, 0.0, 0.0, 0.0, 1e30, 0.0, 0.0, 0.0, 1e30),
    ],
)
def test_nine_numbers_that_are_no_rotation_are_no_pose(rotation: tuple[float, ...]) -> None:
    _, _, (body,) = parsed_data(data_of(BODY.pack(1.0, 2.0, 3.0, *rotation, 0.1)))
    assert not body.visible


@pytest.mark.parametrize("count", [1001, 2**31, 2**32 - 1])
def test_a_huge_number_of_bodies_is_refused_before_they_are_read(count: int) -> None:
    bodies = BODIES.pack(count, 0, 0) + bytes(BODY.size * 1100)
    component = COMPONENT.pack(COMPONENT.size + len(bodies), SIX_D_WITH_RESIDUAL) + bodies
    with pytest.raises(ValueError, match="bodies is damaged"):
        parsed_data(DATA.pack(1, 1, 1) + component)


def test_a_huge_number_of_components_is_refused_before_they_are_read() -> None:
    with pytest.raises(ValueError, match="components is damaged"):
        parsed_data(DATA.pack(1, 1, 2**32 - 1) + bytes(1 << 16))


@pytest.mark.parametrize("size", [0, 7, 1 << 24 | 1, 2**32 - 1])
def test_a_size_that_cannot_be_is_noise(size: int) -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        theirs.sendall(struct.pack("<II", size, 1))
        with pytest.raises(ValueError, match=f"a packet of {size} bytes"):
            Packets(ours).receive(timeout=WAIT)


@given(st.text(max_size=200))
@example("<!DOCTYPE x [<!ENTITY a 'b'>]><x>&a;</x>")
def test_settings_of_any_text_are_names_or_an_error(settings: str) -> None:
    try:
        names = body_names(settings)
    except ValueError:
        return
    assert all(isinstance(name, str) for name in names)


# ---------------------------------------------------------------------- servers


def test_a_server_of_another_version_is_told() -> None:
    refusal = text(Type.ERROR, "Version NOT supported")
    with (
        answering(text(Type.COMMAND, GREETING), refusal) as port,
        pytest.raises(ValueError, match="the server says: Version NOT supported"),
    ):
        QualisysConnection("127.0.0.1", port)


def test_two_drivers_read_one_server(segment: str) -> None:
    robot = o80.robots.load(Qualisys)
    with (
        FakeQualisys(["racket"]) as server,
        robot.inline(segment, frequency=1000, port=server.port) as one,
        robot.inline(f"{segment}-two", frequency=1000, port=server.port) as two,
    ):
        for system in (one, two, one):
            row_where(system, lambda row: row.reason == Reason.SEEN)


# ---------------------------------------------------------------------- messages of a tracker


@given(st.binary(max_size=200))
def test_a_message_of_any_bytes_is_a_row_without_a_ball(content: bytes) -> None:
    seen = ServerTrack(Options()).take(content, 10**9)
    assert seen.reason in (ServerReason.invalid, ServerReason.not_seen, ServerReason.seen)
    if seen.reason != ServerReason.seen:
        assert np.isnan(seen.ball.position).all()


@pytest.fixture
def publisher() -> Iterator[FakeTrackingServer]:
    server = FakeTrackingServer("tcp://127.0.0.1:0")
    yield server
    server.close()


def test_a_huge_message_is_not_taken_and_the_next_ones_are(
    publisher: FakeTrackingServer, segment: str
) -> None:
    robot = o80.robots.load(TrackingServer)
    with robot.inline(segment, address=publisher.address) as server:

        def row_after(content: Callable[[], bytes], reason: ServerReason) -> None:
            """Publishes until a row has the reason."""

            def comes(row: Any) -> bool:
                publisher.publish(content())
                return bool(row.reason == reason)

            row_where(server, comes)

        def small() -> bytes:
            return Message(time.monotonic_ns(), None).encoded()

        row_after(small, ServerReason.not_seen)
        row_after(lambda: b" " * LARGEST_MESSAGE + small(), ServerReason.invalid)
        row_after(small, ServerReason.not_seen)
