"""Clients that block, in a process that is watched: the real ones, with nobody at the other end."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from device_rows import WAIT, row_where
from exclusive import alone_with

import o80
from o80_devices.fakes.qualisys import FakeQualisys
from o80_devices.motion_capture.sensor import Reason
from o80_devices.motion_capture.transform import quaternion_of
from o80_devices.motion_capture.watched import CHILD, Watched
from o80_devices.motion_capture.watched_child import bodies_of

PORT = 22223
ROBOT = o80.robots.load(Watched)


def clients() -> list[int]:
    """Child processes of this one that run a client."""
    return [
        int(child)
        for task in Path("/proc/self/task").iterdir()
        for child in told_of(task / "children").split()
        if b"watched_child" in told_of(Path(f"/proc/{child.decode()}/cmdline"))
    ]


def told_of(path: Path) -> bytes:
    """Text of the kernel about a process or thread; empty if that has ended."""
    try:
        return path.read_bytes()
    except OSError:
        return b""


def clients_of(system: Any, condition: Callable[[list[int]], bool]) -> list[int]:
    """The clients, once they are so: they may end between two looks."""
    seen: list[int] = []

    def are_so(_row: Any) -> bool:
        seen[:] = clients()
        return condition(seen)

    row_where(system, are_so)
    return seen


@pytest.mark.parametrize("kind", ["mock", "vicon"])
def test_a_client_without_poses_is_a_gap_and_is_started_again(kind: str, segment: str) -> None:
    """The mock gives empty frames for ever; that of Vicon blocks and ignores signals."""
    with ROBOT.inline(segment, frequency=1000, system=kind, subjects="racket") as system:
        row = row_where(system, lambda row: row.reason == Reason.SILENT)
        assert not row.racket.visible
        assert row.capture_time == 0
        first = clients_of(system, bool)
        clients_of(system, lambda found: bool(found) and found != first)
    assert not clients()


def test_a_client_that_dies_is_started_again(segment: str) -> None:
    with ROBOT.inline(segment, frequency=1000, system="vicon", subjects="racket") as system:
        (first,) = clients_of(system, bool)
        os.kill(first, signal.SIGKILL)
        clients_of(system, lambda found: bool(found) and first not in found)


def test_an_interrupt_ends_a_driver_whose_client_blocks(segment: str) -> None:
    o80_program = str(Path(sys.executable).parent / "o80")
    place = "o80_devices.motion_capture:Watched"
    run = subprocess.Popen(
        [
            *(o80_program, "run", place, "--segment", segment, "--frequency", "300"),
            *("--system", "vicon", "--subjects", "racket"),
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    with o80.Frontend(segment, timeout=WAIT) as system:
        system.wait_for(50, timeout=WAIT)
    run.send_signal(signal.SIGINT)
    output, _ = run.communicate(timeout=WAIT)
    assert run.returncode == 0, output


def test_bodies_are_read_from_the_bindings() -> None:
    class Rotation:
        x, y, z, w = 0.0, 0.0, 1.0, 0.0

    class Body:
        position = (1.0, 2.0, 3.0)
        rotation = Rotation()

    assert bodies_of({"a": Body()}) == {"a": ([1.0, 2.0, 3.0], [0.0, 0.0, 1.0, 0.0])}


SLOW_CLIENT = """
import math
import time

time.sleep(1.5)  # longer than the silence that ends a client


class Rotation:
    x = y = z = 0.0
    w = 1.0


class Body:
    rotation = Rotation()

    def __init__(self, x):
        self.position = (x, 0.0, 0.0)


class Connection:
    rigidBodies = {"racket": Body(1.0), "covered": Body(math.nan)}

    def waitForNextFrame(self):
        time.sleep(0.01)


def connect(system, options):
    return Connection()
"""


@pytest.fixture
def slow_client(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A package motioncapture that takes its time to be imported."""
    (tmp_path / "motioncapture.py").write_text(SLOW_CLIENT)
    before = os.environ.get("PYTHONPATH")
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}:{before}" if before else str(tmp_path))


@pytest.mark.usefixtures("slow_client")
def test_a_client_that_starts_slowly_is_not_killed_before_it_connects(segment: str) -> None:
    with ROBOT.inline(segment, frequency=1000, subjects="racket,covered") as system:
        row = row_where(system, lambda row: row.reason == Reason.SEEN)
        assert list(row.racket.position) == [1.0, 0.0, 0.0]
        assert not row.covered.visible
    assert not clients()


def test_a_client_whose_driver_has_died_meanwhile_ends() -> None:
    """The kernel kills it with the driver, but only from its first line on."""
    nobody = "0"
    command = [sys.executable, "-m", CHILD, "vicon", "127.0.0.1", nobody]
    assert subprocess.run(command, timeout=WAIT, check=False).returncode == 0


TURN = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
TILTED = ((1.0, -2.0, 0.5), (TURN * np.linalg.det(TURN)).ravel().tolist())  # a rotation


def test_a_pose_of_a_real_client_comes_through_the_process(segment: str) -> None:
    """The client of `motioncapture` for Qualisys, which uses the ports 22223 and 6734."""
    with (
        alone_with("qualisys"),
        FakeQualisys(["racket", "table"], port=PORT, poses=lambda *_: TILTED) as server,
        ROBOT.inline(segment, frequency=1000, system="qualisys", subjects="racket") as system,
    ):
        row = row_where(system, lambda row: row.reason == Reason.SEEN)
        check_tilted(row)
        server.faults.hidden = {"racket"}
        row = row_where(system, lambda row: row.reason == Reason.SEEN and not row.racket.visible)
        assert np.isnan(row.racket.position).all()
        server.faults.silent = True
        row_where(system, lambda row: row.reason == Reason.SILENT)
        row_where(system, lambda row: row.reason == Reason.DISCONNECTED)
        server.faults.silent, server.faults.hidden = False, set()
        check_tilted(row_where(system, lambda row: row.reason == Reason.SEEN))
    assert not clients()


def check_tilted(row: Any) -> None:
    """Also tells a rotation from its transpose."""
    assert row.racket.visible
    assert row.racket.position == pytest.approx(TILTED[0], abs=1e-6)
    expected = np.array(quaternion_of(np.reshape(TILTED[1], (3, 3))))
    measured = np.asarray(row.racket.quaternion)
    assert measured * np.sign(measured[3]) == pytest.approx(expected, abs=1e-5)
