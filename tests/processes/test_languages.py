"""Backends and frontends of the two languages meet in every pairing."""

import contextlib
import os
import signal
import subprocess
import threading
from pathlib import Path

import numpy as np
import pytest

import o80


def commander(prefix: Path, segment: str, target: float) -> "subprocess.Popen[str]":
    """A C++ frontend, as a process."""
    return subprocess.Popen(
        [str(prefix / "bin" / "o80_commander"), segment, str(target)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def serve(backend: o80.Backend, process: "subprocess.Popen[str]") -> None:
    """Iterates until the frontend's process has ended."""
    state = np.zeros(2)
    backend.publish(state)
    while process.poll() is None:
        with contextlib.suppress(o80.TimeoutError):
            backend.publish(backend.step(timeout=0.05))


@pytest.mark.parametrize("bursting", [False, True])
def test_a_cpp_frontend_commands_a_python_backend(build_prefix: Path, bursting: bool) -> None:
    name = f"test-{os.getpid()}-python"
    with o80.Backend(name, ["left", "right"], bursting=bursting) as backend:
        process = commander(build_prefix, name, 0.75)
        serve(backend, process)
        output, errors = process.communicate()
    assert process.returncode == 0, errors
    assert output.startswith("0.75 at ")


@pytest.mark.parametrize("bursting", [False, True])
def test_cpp_and_python_frontends_command_one_cpp_backend(
    build_prefix: Path, bursting: bool
) -> None:
    name = f"test-{os.getpid()}-cpp"
    robot = o80.robots.load("two_joints")
    with robot.start(name, bursting=bursting) as process, process.frontend() as frontend:
        frontend.add_command("elbow", -0.5, iterations=10)
        frontend.pulse_and_wait(timeout=20.0)
        with commander(build_prefix, name, 0.25) as other:
            output, errors = other.communicate(timeout=60)
        assert other.returncode == 0, errors
        assert output.startswith("0.25 at ")
        assert frontend.latest().desired.tolist() == [0.25, -0.5]


def test_a_cpp_frontend_says_when_a_python_backend_was_killed(build_prefix: Path) -> None:
    name = f"test-{os.getpid()}-killed"
    ready, go_on = os.pipe()
    child = os.fork()
    if child == 0:
        # a bursting backend that publishes row 0 and then does nothing more
        backend = o80.Backend(name, ["only"], bursting=True)
        backend.publish(np.zeros(1))
        os.write(go_on, b"x")
        signal.pause()
        os._exit(0)
    try:
        os.read(ready, 1)
        process = commander(build_prefix, name, 1.0)
        with o80.Frontend(name, read_only=True) as reader:
            ended = threading.Event()

            def wait_in_vain() -> None:
                with pytest.raises(o80.BackendKilled):
                    reader.wait_for(1000, timeout=60.0)
                ended.set()

            waiter = threading.Thread(target=wait_in_vain)
            waiter.start()
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            waiter.join(60.0)
            assert ended.is_set()
            assert reader.history(10).observed.tolist() == [[0.0]]
        _, errors = process.communicate(timeout=60)
        assert process.returncode == 1
        assert name in errors
    finally:
        os.close(ready)
        os.close(go_on)
        o80.clean(name)
