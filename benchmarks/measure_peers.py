"""Other packages for the same task, in turn with o80: mujoco.batch, Gymnasium, iceoryx2, files.

A package that is not installed is skipped.
"""

import ctypes
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from signal import SIGCONT, SIGSTOP, SIGTERM, signal
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Space
from gymnasium.vector import VectorEnv

import o80
from o80.datasets.export import write
from o80.learning import GroupTask, Index, Outcome, VectorEnvironment
from sampling import rounds, sample, seconds, take_priority

MODEL = Path(__file__).parents[1] / "examples" / "python" / "models" / "cart_pole.xml"
COPIES, THREADS = 64, 2
STEPS = 50  # in a round
EPISODE = 22  # steps of a CartPole under random actions, on average
BURSTS = 2000  # in a round
ROWS = 60_000
COLUMNS = ["observed.shoulder", "observed.elbow", "desired.shoulder", "desired.elbow"]
COLUMNS += ["extended.effort[0]", "extended.effort[1]"]


def in_turn(calls: Mapping[str, Callable[[], object]], unit: str, scale: float) -> None:
    """Samples the durations of these calls."""
    for call in calls.values():
        call()
    for _ in range(rounds()):
        for name, call in calls.items():
            sample(name, unit, seconds(call) * scale)


@contextmanager
def needing(package: str, *names: str) -> Iterator[None]:
    """Skips samples that need a missing package."""
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name != package:
            raise
        for name in names:
            print(name, "skipped", f"{package} is not installed", sep="\t", flush=True)


def simulate() -> None:
    """Ten steps a call, a row for each step with the model's sensors; observations are read."""
    import mujoco
    from mujoco.batch import Batch

    batch = Batch(mujoco.MjModel.from_xml_path(str(MODEL)), COPIES, THREADS)
    control, read = batch.ctrl, (batch.qpos, batch.qvel, batch.sensordata)
    group = o80.robots.load("mujoco").inline(
        copies=COPIES, threads=THREADS, model=MODEL, mode="control", frequency=500
    )
    burst, seen = group.prepared_burst(10), group.gather(["extended"])
    drawn = np.random.default_rng(1).uniform(-20, 20, (STEPS, COPIES, 1))

    def ours() -> None:
        for targets in drawn:
            burst.targets[:, 0] = targets
            burst.run()
            seen.observations.copy()

    def theirs() -> None:
        for targets in drawn:
            control[:] = targets
            batch.step(nstep=10)
            np.hstack(read)

    with group:
        in_turn({"mujoco_rows": ours, "mujoco_batch": theirs}, "us", 1e6 / STEPS)


class Trivial(GroupTask):
    """Two joints without a purpose, whose episodes are as long as those of CartPole."""

    def __init__(self, copies: int) -> None:
        group = o80.robots.load("two_joints").inline(copies=copies, threads=THREADS)
        super().__init__(
            group,
            burst=group.prepared_burst(1),
            seen=group.gather(
                ["observed", "desired"], {"end": ("desired.elbow", ">", 1.0 - 2.0 / EPISODE)}
            ),
            observation_space=Box(-3, 3, (4,), np.float32),
            action_space=Box(-1, 1, (2,), np.float32),
            max_steps=500,
            reset=group.prepared_request("reset"),
        )

    def begin(self, copies: Any, generators: Sequence[np.random.Generator], options: Any) -> None:
        pass

    def judge(self, copies: Index) -> Outcome:
        return Outcome(reward=1.0, terminated=self.seen["end"][copies])


def step(environment: VectorEnv[Any, Any, Any], actions: Space[Any]) -> Callable[[], None]:
    """A round of steps under random actions, episodes one after the other."""
    actions.seed(1)
    drawn = [actions.sample() for _ in range(STEPS)]
    environment.reset(seed=1)

    def play() -> None:
        for each in drawn:
            environment.step(each)

    return play


def environments() -> None:
    import gymnasium

    with ExitStack() as stack:
        ours = stack.enter_context(VectorEnvironment(Trivial(COPIES)))
        theirs = gymnasium.make_vec("CartPole-v1", COPIES, "vector_entry_point")
        calls = {
            "vector_64": step(ours, ours.action_space),
            "numpy_cart_pole_64": step(theirs, theirs.action_space),
        }
        with needing("envpool", "envpool_cart_pole_64"):
            import envpool

            pool = envpool.make_gymnasium("CartPole-v1", num_envs=COPIES, num_threads=THREADS)
            calls["envpool_cart_pole_64"] = step(pool, theirs.action_space)
        in_turn(calls, "us", 1e6 / STEPS)


class Asked(ctypes.Structure):
    _fields_ = [("numbers", ctypes.c_double * 2)]


class Answered(ctypes.Structure):
    _fields_ = [("numbers", ctypes.c_double * 11)]


def service() -> Any:
    """Requests and responses of as many bytes as a target and a row of two joints."""
    import iceoryx2

    iceoryx2.set_log_level(iceoryx2.LogLevel.Error)
    node = iceoryx2.NodeBuilder.new().create(iceoryx2.ServiceType.Ipc)
    named = node.service_builder(iceoryx2.ServiceName.new("o80-bench"))
    return named.request_response(Asked, Answered).open_or_create()


def serve() -> None:
    """Answers until it is terminated, or its parent has ended; it polls."""
    parent = os.getppid()
    ended: list[int] = []  # an exception in the handler can be lost in a destructor
    signal(SIGTERM, lambda number, _: ended.append(number))  # it removes its files
    server = service().server_builder().create()
    print(flush=True)
    while not ended and os.getppid() == parent:
        if (request := server.receive()) is not None:
            request.payload()
            request.send_copy(Answered())


def requests() -> None:
    """A request and its response between two processes, beside a burst of an iteration."""
    with ExitStack() as stack, needing("iceoryx2", "iceoryx2_round_trip"):
        client = service().client_builder().create()
        command = [sys.executable, __file__, "serve"]
        server = stack.enter_context(subprocess.Popen(command, stdout=subprocess.PIPE))
        stack.callback(server.send_signal, SIGCONT)  # to end, after the signal for that
        stack.callback(server.terminate)
        assert server.stdout is not None
        server.stdout.readline()
        robot = stack.enter_context(o80.robots.load("two_joints").start(bursting=True))
        arm = stack.enter_context(robot.frontend())

        def theirs() -> None:
            server.send_signal(SIGCONT)
            for _ in range(BURSTS):
                pending = client.send_copy(Asked())
                while (response := pending.receive()) is None:
                    pass
                response.payload()
            server.send_signal(SIGSTOP)  # it would poll while the other is measured

        def ours() -> None:
            for _ in range(BURSTS):
                arm.burst(1)

        in_turn({"round_trip": ours, "iceoryx2_round_trip": theirs}, "us", 1e6 / BURSTS)


def files() -> None:
    """Six columns of a recording as arrays, beside those of exported files."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.mcap"
        robot = o80.robots.load("two_joints").inline(segment="bench-peers", history=ROWS + 10)
        with robot as arm, o80.Recording(path, arm):
            for _ in range(ROWS // 1000):
                arm.burst(1000)
        history = o80.open(path)["bench-peers"].history()
        calls: dict[str, Callable[[], object]] = {}

        def ours() -> None:
            columns = o80.open(path)["bench-peers"].history(fields=COLUMNS)
            assert all(len(column) == ROWS + 1 for column in columns)

        calls["recorded_columns"] = ours
        with needing("h5py", "h5py_columns"):
            import h5py

            write(path.with_suffix(".h5"), {"arm": history})

            def hdf5() -> None:
                with h5py.File(path.with_suffix(".h5")) as file:
                    assert all(len(file["arm"][column][:]) == ROWS + 1 for column in COLUMNS)

            calls["h5py_columns"] = hdf5
        with needing("pyarrow", "pyarrow_columns"):
            from pyarrow import parquet

            write(path.with_suffix(".parquet"), {"arm": history})

            def columns() -> None:
                table = parquet.read_table(path.with_suffix(".parquet"), columns=COLUMNS)
                assert all(len(table[column].to_numpy()) == ROWS + 1 for column in COLUMNS)

            calls["pyarrow_columns"] = columns
        in_turn(calls, "ms", 1e3)


def main() -> None:
    if sys.argv[1] == "serve":
        return serve()
    take_priority()
    requests()
    files()
    environments()
    with needing("mujoco", "mujoco_batch"):
        simulate()
    return None


if __name__ == "__main__":
    main()
