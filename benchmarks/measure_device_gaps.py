"""How long after a pulled cable the first row of a device says so.

Each driver runs as a process, its counterpart beside it. The cable is pulled by silence: the
counterpart keeps its connections and sends nothing more.
"""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import o80
from o80_devices.ball_launcher.launcher import Status
from o80_devices.ball_tracking.server_messages import ServerReason
from o80_devices.cameras.newest_image import CameraReason
from o80_devices.fakes.qualisys import FakeQualisys
from o80_devices.fakes.tracking_server import FakeTrackingServer, thrown
from o80_devices.motion_capture import Reason
from sampling import rounds, sample

WAIT = 20.0  # longer than anything here takes [s]
SLOWEST_ROWS = 0.02  # of the launcher [s]
NAME = f"bench-gap-{os.getpid()}"


class Cable(NamedTuple):
    """pull: nothing comes through from now on. mend: the opposite."""

    pull: Callable[[], object]
    mend: Callable[[], object]


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as unused:
        port: int = unused.getsockname()[1]
        return port


@contextlib.contextmanager
def process(*command: str) -> Iterator[Cable]:
    """A counterpart that is stopped by a signal: the kernel keeps its connections."""
    running = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield Cable(
            lambda: running.send_signal(signal.SIGSTOP), lambda: running.send_signal(signal.SIGCONT)
        )
    finally:
        running.kill()
        running.wait()


@contextlib.contextmanager
def published(server: FakeTrackingServer) -> Iterator[Cable]:
    """A tracking server at work."""
    quiet, ends = threading.Event(), threading.Event()

    def run() -> None:
        begin = time.monotonic_ns()
        for at, message in thrown(seed=1, noise=0.003):
            if ends.wait(max(0.0, (begin + at - time.monotonic_ns()) * 1e-9)):
                return
            if not quiet.is_set():
                server.publish(message)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield Cable(quiet.set, quiet.clear)
    finally:
        ends.set()
        thread.join()
        server.close()


def row_where(device: Any, condition: Callable[[Any], bool]) -> Any:
    """The next row that meets a condition."""
    end = time.monotonic() + WAIT
    for observation in device.stream():
        if condition(observation.extended):
            return observation
        if time.monotonic() > end:
            raise SystemExit(f"no row as expected within {WAIT} s: {observation.extended}")
    raise SystemExit("the driver has ended")


def measure(
    name: str,
    robot: str,
    cable: Cable,
    works: Callable[[Any], bool],
    gone: Callable[[Any], bool],
    **options: Any,
) -> None:
    with (
        o80.robots.load(robot).start(f"{NAME}-{name}", **options) as running,
        running.frontend() as device,
    ):
        for i in range(rounds()):
            row_where(device, works)
            # at another moment between two rows each time
            time.sleep(i / rounds() * SLOWEST_ROWS)
            begin = time.monotonic_ns()
            cable.pull()
            row = row_where(device, gone)
            sample(name, "ms", (row.time - begin) * 1e-6)
            cable.mend()


def motion_capture() -> None:
    with FakeQualisys(frequency=300.0) as server:
        cable = Cable(
            lambda: setattr(server.faults, "silent", True),
            lambda: setattr(server.faults, "silent", False),
        )
        measure(
            "gap_motion_capture",
            "o80_devices.motion_capture:Qualisys",
            cable,
            lambda row: bool(row.reason == Reason.SEEN),
            lambda row: row.reason not in (Reason.SEEN, Reason.NO_NEW_FRAME),
            frequency=300,
            port=server.port,
        )


def tracking_server() -> None:
    server = FakeTrackingServer("tcp://127.0.0.1:0")
    with published(server) as cable:
        measure(
            "gap_tracking_server",
            "o80_devices.ball_tracking.tracking_server:TrackingServer",
            cable,
            lambda row: row.reason in (ServerReason.seen, ServerReason.not_seen),
            lambda row: bool(row.reason == ServerReason.silent),
            address=server.address,
        )


def launcher() -> None:
    address = f"tcp://127.0.0.1:{free_port()}"
    fake = (sys.executable, "-m", "o80_devices.fakes.ball_launcher", "--address", address)
    with process(*fake, "--state-time", "0.05") as cable:
        measure(
            "gap_launcher",
            "o80_devices.ball_launcher:BallLauncher",
            cable,
            lambda row: bool(row.status == Status.ready),
            lambda row: bool(row.status == Status.disconnected),
            address=address,
        )


def cameras() -> None:
    with process("arv-fake-gv-camera-0.8", "-i", "127.0.0.1") as cable:
        measure(
            "gap_cameras",
            "o80_devices.ball_tracking:GenicamCameras",
            cable,
            lambda row: bool(row.valid[0]),
            lambda row: row.reasons.camera_0 not in (CameraReason.seen, CameraReason.no_new_image),
            frequency=180,
            history=8,
            sources="127.0.0.1",
            rate=180.0,
            pixel_format="Mono8",
        )


def main() -> None:
    for device in (motion_capture, tracking_server, launcher, cameras):
        device()


if __name__ == "__main__":
    main()
