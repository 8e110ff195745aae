"""Child process in which `motioncapture` may block: prints each frame as a line of JSON."""

from __future__ import annotations

import ctypes
import importlib
import os
import signal
import sys
import time
from typing import Any

from o80.base.descriptors import open_standard_streams
from o80.base.finite import json_text

STARTED = b"started"
"""First line, printed when the client begins to connect. Each later one is a frame in JSON."""
PR_SET_PDEATHSIG = 1


def main() -> None:
    # a blocked client does not detect the death of the driver
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    system, host, driver = sys.argv[1:4]
    if os.getppid() != int(driver):
        return  # the driver died before the line above
    # the library prints to stdout: frames are written to a copy, all else to stderr
    frames = os.dup(1)
    os.dup2(2, 1)
    client: Any = importlib.import_module("motioncapture")
    os.write(frames, STARTED + b"\n")
    connection = client.connect(system, {"hostname": host})
    while True:
        connection.waitForNextFrame()
        arrival = time.monotonic_ns()
        line = json_text((arrival, bodies_of(connection.rigidBodies)), say=lambda _: None) + "\n"
        try:
            os.write(frames, line.encode())
        except BrokenPipeError:
            return


def bodies_of(rigid_bodies: Any) -> dict[str, Any]:
    """Returns position and quaternion (x, y, z, w) of each body by name."""
    found = {}
    for name, body in rigid_bodies.items():
        rotation = body.rotation
        quaternion = [rotation.x, rotation.y, rotation.z, rotation.w]
        found[name] = ([float(each) for each in body.position], quaternion)
    return found


if __name__ == "__main__":
    open_standard_streams()
    main()
