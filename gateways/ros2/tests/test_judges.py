"""rclpy of two versions of ROS 2, and Cyclone DDS without ROS, judge what the gateway sends."""

import contextlib
import json
import os
import random
import select
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

import o80

pytestmark = pytest.mark.check

HERE = Path(__file__).resolve().parent
ROS = HERE.parents[2] / "build" / "ros"
PROFILES = str(HERE / "loopback.xml")
VERSIONS = ("jazzy", "kilted")
COUNT = 900  # samples, fewer than the gateway keeps until they are acknowledged
HASH = "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e"


def free_domain() -> int:
    """A domain of DDS in which nobody listens: parallel runs do not hear each other."""
    for domain in random.sample(range(1, 100), 99):
        probe = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        with probe, contextlib.suppress(OSError):
            probe.bind(("", 7410 + 250 * domain))  # of the first participant
            return domain
    pytest.fail("every domain of DDS is in use")


def environment(domain: int, **more: str) -> dict[str, str]:
    own = {
        "ROS_DOMAIN_ID": str(domain),
        # only loopback, and no shared memory, in which a port belongs to all programs of a machine
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT",
        "FASTRTPS_DEFAULT_PROFILES_FILE": PROFILES,  # Jazzy
        "FASTDDS_DEFAULT_PROFILES_FILE": PROFILES,  # Kilted
    }
    return os.environ | own | more


def python_of(version: str) -> str:
    python = ROS / version / "bin" / "python"
    if not python.exists():
        pytest.skip(f"there is no {python}: tools/setup.sh check installs rclpy there")
    return str(python)


@contextlib.contextmanager
def program(*words: str, env: dict[str, str]) -> Iterator["subprocess.Popen[str]"]:
    """A process that prints lines, ended with the block."""
    with subprocess.Popen(words, stdout=subprocess.PIPE, env=env, text=True) as process:
        try:
            yield process
        finally:
            process.terminate()


def prints(process: "subprocess.Popen[str]", patience: float = 0.0) -> bool:
    """Whether it has printed something that was not read."""
    return process.stdout in select.select([process.stdout or 0], [], [], patience)[0]


def line(process: "subprocess.Popen[str]") -> str:
    """The next line that it prints."""
    assert process.stdout is not None
    return process.stdout.readline().strip()


@pytest.fixture(scope="module", autouse=True)
def traces() -> Iterator[None]:
    """The tracing library of the wheels leaves files in /dev/shm: those of these tests go."""

    def found() -> set[Path]:
        return set(Path("/dev/shm").glob("lttng-ust-wait-*"))

    before = found()
    yield
    for file in found() - before:
        file.unlink(missing_ok=True)


@pytest.fixture(scope="module", params=VERSIONS)
def domain(request: pytest.FixtureRequest) -> Iterator[int]:
    """The domain of a gateway under one version of ROS, which carries `sim` and `arm`."""
    python, domain = python_of(request.param), free_domain()
    # the interpreter is that of ROS, o80 that of the tests
    env = environment(domain, PYTHONPATH=str(Path(o80.__file__).parents[1]))
    two_joints = o80.robots.load("two_joints")
    words = (python, "-m", "o80", "ros2", "--command", "--rate", "all")
    sim, arm = two_joints.start("sim", bursting=True), two_joints.start("arm", frequency=200)
    with sim, arm, program(*words, env=env):
        yield domain


def started(process: "subprocess.Popen[str]", sim: o80.Frontend) -> str:
    """The first line of a program that waits for samples."""
    while not prints(process, 0.05):
        sim.burst(1)
    return line(process)


def heard(domain: int, sim: o80.Frontend, *words: str) -> Any:
    """Output of a program that listens to `COUNT` rows after the first that it hears."""
    with program(*words, env=environment(domain)) as process:
        assert started(process, sim) == "ready"
        sim.burst(COUNT)
        return json.loads(line(process))


@pytest.mark.parametrize("client", VERSIONS)
def test_every_sample_after_discovery_arrives_and_rosbags_decodes_it(
    domain: int, client: str
) -> None:
    with o80.Frontend("sim") as sim:
        words = (python_of(client), str(HERE / "judge.py"), "listen", "sim", str(COUNT))
        found = heard(domain, sim, *words)
        assert (found["node"], found["hash"]) == ("o80_ros2", HASH)
        assert {"/sim/halt", "/sim/resume", "/sim/requests/home"} <= {*found["services"]}
        assert found["urdf"].startswith("<robot")
        assert found["reports"]["o80: sim"] == "bursting"
        store = get_typestore(Stores.ROS2_JAZZY)
        states: Any = [
            store.deserialize_cdr(bytes.fromhex(each), "sensor_msgs/msg/JointState")
            for each in found["samples"]
        ]
        times = [each.header.stamp.sec * 10**9 + each.header.stamp.nanosec for each in states]
        rows = sim.history(from_time=times[0], to_time=times[-1])
        assert times == rows.time.tolist(), "every row from the first one on, once, in order"
        assert np.array_equal([each.position for each in states], rows.observed)


@pytest.mark.parametrize("client", VERSIONS)
def test_trajectories_and_calls_move_the_robot(domain: int, client: str) -> None:
    words = (python_of(client), str(HERE / "judge.py"), "command", "arm")
    with program(*words, env=environment(domain)) as process:
        found = json.loads(line(process))
    assert found["halt"].startswith("halt ")
    assert found["resume"] == "the halt has ended"
    assert found["home"] == "home has ended"


def test_cyclone_dds_hears_every_sample_if_it_ignores_type_information(
    domain: int, request: pytest.FixtureRequest
) -> None:
    words = (sys.executable, str(HERE / "judge_dds.py"), "sim", str(COUNT))
    with o80.Frontend("sim") as sim, program(*words, "bare", env=environment(domain)) as bare:
        times = heard(domain, sim, *words)
        assert times == sim.history(from_time=times[0], to_time=times[-1]).time.tolist()
        if "jazzy" in request.node.name:
            assert started(bare, sim) == "ready"
        else:  # type objects of Kilted are wrong (rmw_fastrtps 875)
            assert not prints(bare)
