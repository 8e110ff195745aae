"""The calls of a Python frontend."""

import ctypes
import tempfile
import time

import mujoco
import numpy as np
from numpy.typing import NDArray

import o80
from o80.frontend.prepared_burst import PreparedBurst
from sampling import built, rounds, sample, seconds, take_priority

ROWS = 10_000
CALLS = 2000
COMMANDS = 1000
HISTORIES = 5  # in a round
DECISIONS = 500  # in a round


def start_robot() -> None:
    """From the start of a robot's process to its first row, and another frontend's attachment."""
    robot = o80.robots.load("two_joints")
    begin = time.perf_counter()
    with robot.start(bursting=True) as process, process.frontend() as arm:
        arm.latest()
        sample("python_backend_ready", "ms", (time.perf_counter() - begin) * 1e3)
        begin = time.perf_counter()
        with o80.Frontend(arm.segment):
            sample("python_frontend_attached", "ms", (time.perf_counter() - begin) * 1e3)


def command(arm: o80.Frontend) -> None:
    """Commands added, sent, and dropped again by the backend before the next round."""

    def add() -> None:
        for _ in range(COMMANDS):
            arm.add_command(0, 0.5, duration=2.0)

    sample("python_add_command", "us", seconds(add) / COMMANDS * 1e6)
    sample("python_pulse_1000", "us", seconds(arm.pulse) * 1e6)
    arm.purge().wait(5.0)


def read(arm: o80.Frontend) -> None:
    def latest() -> None:
        for _ in range(CALLS):
            arm.latest()

    sample("python_latest", "us", seconds(latest) / CALLS * 1e6)

    # in turn, after the first pages were touched
    rows = arm.history(ROWS).rows
    target = np.ones_like(rows)
    pointers = (target.ctypes.data, rows.ctypes.data)
    for turn in range(HISTORIES + 2):
        copied = seconds(lambda: ctypes.memmove(*pointers, rows.nbytes))
        got = seconds(lambda: arm.history(ROWS))
        if turn < 2:
            continue
        sample("memcpy_same_bytes", "GB/s", rows.nbytes / copied * 1e-9)
        sample("python_history", "GB/s", rows.nbytes / got * 1e-9)


def burst(arm: o80.Frontend) -> None:
    def once() -> None:
        for _ in range(CALLS):
            arm.burst(1)

    sample("python_burst_1", "us", seconds(once) / CALLS * 1e6)


def follow_trajectory(arm: o80.Frontend, targets: NDArray[np.float64]) -> None:
    def send() -> None:
        arm.add_trajectory(targets, iterations=1)
        arm.pulse()

    sample("python_trajectory", "ms", seconds(send) * 1e3)
    arm.purge().wait(5.0)


def arm_model(joints: int) -> str:
    """A chain of capsules, each turned by a position actuator."""
    bodies = "".join(
        f'<body name="b{i}" pos="0 0 0.2"><joint name="j{i}" axis="{i % 2} {1 - i % 2} 0"'
        ' damping="1"/><geom type="capsule" fromto="0 0 0 0 0 0.2" size="0.03"/>'
        for i in range(joints)
    )
    servos = "".join(f'<position name="j{i}" joint="j{i}" kp="50"/>' for i in range(joints))
    world = f"<worldbody>{bodies}{'</body>' * joints}</worldbody>"
    return f"<mujoco>{world}<actuator>{servos}</actuator></mujoco>"


def decide() -> None:
    """A decision of ten steps of an engine: as ten rows, as one, and without o80."""
    targets = np.random.default_rng(2).uniform(-0.5, 0.5, (DECISIONS, 6))
    with tempfile.NamedTemporaryFile("w", suffix=".xml") as file:
        file.write(arm_model(6))
        file.flush()
        model = mujoco.MjModel.from_xml_path(file.name)
        data = mujoco.MjData(model)
        simulated = o80.robots.load("mujoco")
        fast = simulated.inline(frequency=500, model=file.name, mode="control")
        slow = simulated.inline(frequency=50, model=file.name, mode="control")
    with fast, slow:
        ten, one = fast.prepared_burst(10), slow.prepared_burst(1)

        def plain() -> None:
            for each in targets:
                data.ctrl[:] = each
                mujoco.mj_step(model, data, 10)

        def burst(prepared: PreparedBurst) -> None:
            for each in targets:
                prepared.targets[0] = each
                prepared.run()

        for _ in range(rounds()):
            for name, call in (
                ("mj_step_10", plain),
                ("mujoco_decision_10_rows", lambda: burst(ten)),
                ("mujoco_decision_1_row", lambda: burst(one)),
            ):
                sample(name, "us", seconds(call) / DECISIONS * 1e6)


def main() -> None:
    take_priority()
    for _ in range(min(rounds(), 7)):
        start_robot()
    two = o80.robots.load("two_joints").start(bursting=True)
    eight = o80.robots.load(str(built() / "lib" / "o80" / "robots" / "eight_empty.so")).start(
        bursting=True
    )
    targets = np.random.default_rng(1).random((ROWS, 8))
    with two, two.frontend() as arm, eight, eight.frontend() as many:
        arm.burst(ROWS + 10)
        for _ in range(rounds()):
            burst(arm)
            read(arm)
            command(arm)
            follow_trajectory(many, targets)
    decide()


if __name__ == "__main__":
    main()
