"""The Qualisys client against a fake server at the wire, with what goes wrong in a lab."""

import math
import socket
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from device_rows import WAIT, answering, row_where

import o80
from o80_devices.fakes.qualisys import FakeQualisys
from o80_devices.motion_capture.qualisys import Qualisys, body_names
from o80_devices.motion_capture.qualisys_packets import (
    BODY,
    HEADER,
    SIX_D_WITH_RESIDUAL,
    Packets,
    Type,
    data_packet,
    parsed_data,
    text,
)
from o80_devices.motion_capture.sensor import Reason

ROBOT = o80.robots.load(Qualisys)


@pytest.fixture
def server() -> Iterator[FakeQualisys]:
    with FakeQualisys(["racket", "TT Platte 1"], frequency=200.0) as served:
        yield served


@pytest.fixture
def system(server: FakeQualisys, segment: str) -> Iterator[o80.Frontend]:
    """The driver inside this process: each burst reads what has arrived."""
    with ROBOT.inline(segment, frequency=1000, port=server.port) as frontend:
        yield frontend


def is_seen(row: Any) -> bool:
    return bool(row.reason == Reason.SEEN)


# ---------------------------------------------------------------------- packets


def test_a_body_is_parsed_in_metres_and_as_a_quaternion() -> None:
    c, s = math.cos(0.5), math.sin(0.5)
    columns = (c, s, 0, -s, c, 0, 0, 0, 1)  # turned by 0.5 about z
    body = BODY.pack(1000.0, -2000.0, 500.0, *columns, 0.5)
    unseen = BODY.pack(*[math.nan] * 13)
    content = data_packet(123456, 7, {SIX_D_WITH_RESIDUAL: [body, unseen]})[HEADER.size :]
    stamp, number, (seen, hidden) = parsed_data(content)
    assert (stamp, number) == (123456, 7)
    assert seen.position == pytest.approx((1.0, -2.0, 0.5))
    assert seen.quaternion == pytest.approx((0, 0, math.sin(0.25), math.cos(0.25)), abs=1e-6)
    assert seen.quality == pytest.approx(0.0005)
    assert not hidden.visible


def test_a_cut_packet_is_told() -> None:
    content = data_packet(1, 1, {SIX_D_WITH_RESIDUAL: [BODY.pack(*[0.0] * 13)]})[HEADER.size :]
    for length in range(len(content)):
        with pytest.raises(ValueError, match="a data packet is cut"):
            parsed_data(content[:length])


class Endless(socket.socket):
    """Sends a large packet in small parts."""

    def recv(self, size: int, flags: int = 0) -> bytes:
        return b"\xff\xff\x00\x00"  # read as a size: 65535 bytes


def test_a_packet_that_comes_in_parts_is_taken_when_it_is_whole() -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        packets, sent = Packets(ours), text(Type.COMMAND, "hello")
        theirs.sendall(sent[:5])
        assert packets.receive(timeout=0.0) is None
        theirs.sendall(sent[5:])
        assert packets.receive(timeout=WAIT) == (Type.COMMAND, b"hello\0")


def test_a_packet_that_does_not_end_is_silence() -> None:
    with Endless() as line:
        assert Packets(line).receive(timeout=0.0) is None


def test_bodies_are_named_in_the_order_of_the_settings() -> None:
    settings = "<Q><The_6D><Bodies>2</Bodies><Body><Name>b</Name></Body><Body><Name>a</Name>"
    assert body_names(settings + "</Body></The_6D></Q>\r\n") == ["b", "a"]
    with pytest.raises(ValueError, match="not XML"):
        body_names("<Q>")


# ---------------------------------------------------------------------- rows


def test_bodies_are_found_and_their_poses_are_those_of_the_server(system: o80.Frontend) -> None:
    row = row_where(system, is_seen)
    angle = row.stamp * 1e-6
    for name, height in (("racket", 0.0), ("TT_Platte_1", 1.0)):
        body = row[name]
        assert body.visible
        place = (0.1 * math.cos(angle), 0.1 * math.sin(angle), height)
        assert body.position == pytest.approx(place, abs=1e-5)
        assert body.quality == pytest.approx(0.00025)
    assert 0 < row.capture_time <= time.monotonic_ns()
    assert row.frame_number * 5000 == row.stamp


def test_a_hidden_body_is_marked_and_has_no_numbers(
    server: FakeQualisys, system: o80.Frontend
) -> None:
    row_where(system, is_seen)
    server.faults.hidden = {"racket"}
    row = row_where(system, lambda row: is_seen(row) and not row.racket.visible)
    assert np.isnan(row.racket.position).all()
    assert row.TT_Platte_1.visible


def test_a_row_without_a_new_frame_has_no_values(system: o80.Frontend) -> None:
    row_where(system, is_seen)
    row = row_where(system, lambda row: row.reason == Reason.NO_NEW_FRAME)
    assert row.capture_time == row.frame_number == 0
    assert not row.stamped
    assert not row.racket.visible
    assert np.isnan(row.racket.position).all()


def test_lost_frames_are_counted(server: FakeQualisys, system: o80.Frontend) -> None:
    row_where(system, is_seen)
    server.faults.lose = 0.5
    row_where(system, lambda row: is_seen(row) and row.lost_frames >= 5)


# ---------------------------------------------------------------------- faults of the line


def test_a_pulled_cable_is_a_gap_and_is_reconnected(
    server: FakeQualisys, system: o80.Frontend
) -> None:
    row_where(system, is_seen)
    server.faults.silent = True
    quiet = row_where(system, lambda row: row.reason not in (Reason.SEEN, Reason.NO_NEW_FRAME))
    assert not quiet.racket.visible
    assert quiet.capture_time == 0
    row_where(system, lambda row: row.reason == Reason.DISCONNECTED)
    server.faults.silent = False
    assert row_where(system, is_seen).racket.visible


def test_the_gap_is_marked_after_100_ms_of_rows(server: FakeQualisys, system: o80.Frontend) -> None:
    row_where(system, is_seen)
    server.faults.silent = True
    row_where(system, lambda row: row.reason == Reason.SILENT)
    reasons = np.asarray(system.history(150).extended["reason"])
    (silent,) = np.flatnonzero(reasons == Reason.SILENT)
    last = np.flatnonzero(reasons == Reason.SEEN)[-1]
    assert 80 <= silent - last <= 100


def test_a_server_that_restarts_is_a_new_epoch(server: FakeQualisys, system: o80.Frontend) -> None:
    first = row_where(system, is_seen)
    server.restart()
    again = row_where(system, lambda row: is_seen(row) and row.epoch == first.epoch + 1)
    assert again.capture_time >= first.capture_time


def test_bodies_that_are_added_are_asked_for_again(
    server: FakeQualisys, system: o80.Frontend
) -> None:
    row_where(system, is_seen)
    server.bodies.insert(0, "new")
    row = row_where(system, lambda row: is_seen(row) and abs(row.racket.position[2] - 1.0) < 0.1)
    assert row.TT_Platte_1.position[2] == pytest.approx(2.0)


def test_a_driver_whose_bodies_are_named_starts_before_the_server(
    segment: str, capfd: pytest.CaptureFixture[str]
) -> None:
    with FakeQualisys() as unused:
        port = unused.port
    with ROBOT.inline(segment, frequency=1000, port=port, subjects="racket") as system:
        row_where(system, lambda row: row.reason == Reason.DISCONNECTED)
        told = capfd.readouterr().err
        assert f"o80: Qualisys at 127.0.0.1:{port}: " in told
        assert "Connection refused; tries again" in told
        with FakeQualisys(port=port):
            row_where(system, is_seen)


def test_unknown_bodies_of_a_missing_server_are_an_error_that_says_what_to_do(
    segment: str,
) -> None:
    with FakeQualisys() as unused:
        port = unused.port
    with pytest.raises(o80.DriverError, match=r"Start it, correct --host and --port, or name"):
        ROBOT.inline(segment, port=port)


def test_a_misspelled_subject_is_told_with_the_nearest_name(
    server: FakeQualisys, segment: str, capfd: pytest.CaptureFixture[str]
) -> None:
    told = ""

    def comes(_: Any) -> bool:
        nonlocal told
        told += capfd.readouterr().err
        return "TT Platte 1" in told

    with ROBOT.inline(
        segment, frequency=1000, port=server.port, subjects="rackett,TT Plate 1"
    ) as system:
        row_where(system, comes)
        rows = [row_where(system, is_seen) for _ in range(100)]
    told += capfd.readouterr().err
    assert told.count("subject 'rackett': it is covered, or misspelled; did you mean 'racket'") == 1
    assert told.count("subject 'TT Plate 1': it is covered, or misspelled; did you mean") == 1
    assert not rows[-1].rackett.visible


def test_a_foreign_server_is_told(segment: str) -> None:
    with (
        answering(b"HTTP/1.1 400 no\r\n\r\n") as port,
        pytest.raises(o80.DriverError, match="is this the little-endian port 22223"),
    ):
        ROBOT.inline(segment, port=port)


def test_in_real_time_a_row_is_a_frame(server: FakeQualisys, segment: str) -> None:
    with (
        ROBOT.start(segment, frequency=200, port=server.port),
        o80.Frontend(segment) as system,
    ):
        system.wait_for(150, timeout=WAIT)
        rows = system.history(100)
        seen = np.asarray(rows.extended["reason"]) == Reason.SEEN
        assert seen.any()
        captured = rows.extended["capture_time"][seen]
        assert (np.diff(captured) >= 0).all()
        assert (captured <= rows.time[seen]).all()
