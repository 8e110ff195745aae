"""One policy that answers late, played by LeRobot's own client and through chunks, in one table.

Run with LeRobot's Python, which `make check` installs: build/lerobot/bin/python
benchmarks/measure_lerobot.py. The robot is the twin of an SO-101 in real time at 150 Hz, the policy
a script that answers through LeRobot's server with a sine of the wall clock, 30 actions a second.
"""

import argparse
import os
import random
import socket
import tempfile
import threading
import time
from collections.abc import Iterator
from concurrent import futures
from contextlib import contextmanager
from typing import Any

import grpc
import numpy as np
import torch
from numpy.typing import NDArray

FPS, ROWS = 30, 40
SWING, PERIOD = 20.0, 2.5  # of the sine [deg], [s]
DISAGREE = 0.5  # by so much answers differ from each other [deg]


def truth(wall: Any) -> Any:
    """Target of all joints at a time of the wall clock [s], in degrees."""
    return SWING * np.sin(2 * np.pi * np.asarray(wall) / PERIOD)


def server_class() -> Any:
    """LeRobot's server with a script in place of a policy."""
    from lerobot.async_inference.policy_server import PolicyServer, services_pb2

    class Scripted(PolicyServer):
        latency, jitter, twice = 0.1, 0.3, 0.0
        draw = random.Random(1)

        def SendPolicyInstructions(self, request: Any, context: Any) -> Any:  # noqa: N802
            return services_pb2.Empty()

        def _obs_sanity_checks(self, obs: Any, previous_obs: Any) -> bool:
            return obs.get_timestep() not in self._predicted_timesteps

        def _predict_action_chunk(self, observation_t: Any) -> list[Any]:
            self.last_processed_obs = observation_t
            late = 2 if self.draw.random() < self.twice else 1
            time.sleep(late * self.latency * self.draw.uniform(1 - self.jitter, 1 + self.jitter))
            seen = observation_t.get_timestamp()
            places = truth(seen + np.arange(1, ROWS + 1) / FPS)
            places += self.draw.gauss(0, DISAGREE)
            rows = [torch.tensor([place] * 5 + [50.0]) for place in places]
            return list(self._time_action_chunk(seen, rows, observation_t.get_timestep()))

    return Scripted


@contextmanager
def serving(latency: float, jitter: float, twice: float = 0.0) -> Iterator[str]:
    """Address of a server whose answers take so long [s], give or take a share; some twice."""
    from lerobot.async_inference.configs import PolicyServerConfig
    from lerobot.async_inference.policy_server import services_pb2_grpc

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    scripted = server_class()(PolicyServerConfig(host="127.0.0.1", port=port, fps=FPS))
    scripted.latency, scripted.jitter, scripted.twice = latency, jitter, twice
    server = grpc.server(futures.ThreadPoolExecutor(4))
    services_pb2_grpc.add_AsyncInferenceServicer_to_server(scripted, server)
    server.add_insecure_port(f"127.0.0.1:{port}")
    server.start()
    try:
        yield f"127.0.0.1:{port}"
    finally:
        server.stop(None).wait()


def play(
    kind: str, segment: str, latency: float, jitter: float, twice: float, seconds: float
) -> dict[str, Any]:
    """Figures of one client."""
    from lerobot.async_inference.configs import RobotClientConfig
    from lerobot.async_inference.robot_client import RobotClient

    import o80
    from lerobot_robot_o80 import O80Config
    from lerobot_robot_o80.chunks import ChunkClient

    with serving(latency, jitter, twice) as address:
        client = (ChunkClient if kind == "chunks" else RobotClient)(
            RobotClientConfig(
                policy_type="act",
                pretrained_name_or_path="none",
                robot=O80Config(segment=segment, timeout=60.0, fps=FPS),
                actions_per_chunk=ROWS,
                server_address=address,
                fps=FPS,
                aggregate_fn_name="latest_only" if kind == "latest" else "weighted_average",
            )
        )
        assert client.start()
        available, empty = client.actions_available, []

        def actions_available() -> bool:
            empty.append(not available())
            return not empty[-1]

        client.actions_available = actions_available
        receiver = threading.Thread(target=client.receive_actions)
        receiver.start()
        controller = threading.Thread(target=client.control_loop, args=("",))
        controller.start()
        try:
            time.sleep(seconds)
            with o80.Frontend(segment, read_only=True) as arm:
                rows = arm.history(seconds=seconds - 3)  # not the begin
                wall = (rows.time + arm.provenance.wall_clock_offset) * 1e-9
        finally:
            client.shutdown_event.set()
            controller.join()
            receiver.join()
            client.stop()
    desired = np.degrees(rows.desired.joints[:, 0])
    found = figures(desired, wall)
    if kind == "chunks":
        found["starved"] = float(rows.starved[:, 0].mean())
    else:  # steps of its loop in which the queue was empty
        found["starved"] = float(np.mean(empty[3 * FPS :]))
    return found


def figures(desired: NDArray[Any], wall: NDArray[Any]) -> dict[str, float]:
    """Lag [ms], error without it [deg], and the largest change of velocity in 20 ms [deg/s]."""
    lags = np.arange(-0.1, 0.6, 0.002)
    errors = [float(np.sqrt(np.mean((desired - truth(wall - lag)) ** 2))) for lag in lags]
    best = int(np.argmin(errors))
    three = 3  # rows: 20 ms at 150 Hz
    velocity = (desired[three:] - desired[:-three]) / (wall[three:] - wall[:-three])
    change = np.abs(velocity[three:] - velocity[:-three])
    return {
        "lag": 1e3 * lags[best],
        "rest": errors[best],
        "jump": float(change.max()),
    }


KINDS = {"chunks": "chunks", "average": "LeRobot's client", "latest": "the same, latest_only"}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=23.0, help="of each case")
    parser.add_argument("--latencies", type=int, nargs="*", default=[50, 100, 200, 300])
    parser.add_argument("--jitter", type=float, default=0.3, help="share of the latency")
    parser.add_argument("--twice", type=float, default=0.0, help="share of answers twice as late")
    given = parser.parse_args()
    import o80

    print("| answers | played by | lag | rest | largest change of velocity | starved |")
    print("|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)  # LeRobot writes logs there
        os.environ["HF_LEROBOT_HOME"] = folder
        for latency in given.latencies:
            for kind, name in KINDS.items():
                with o80.robots.load("so101_twin").start(f"measured-{os.getpid()}", gap=0) as twin:
                    found = play(
                        kind, twin.segment, latency * 1e-3, given.jitter, given.twice, given.seconds
                    )
                print(
                    f"| {latency} ms | {name} | {found['lag']:.0f} ms | {found['rest']:.1f} deg | "
                    f"{found['jump']:.0f} deg/s | {100 * found['starved']:.1f} % |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
