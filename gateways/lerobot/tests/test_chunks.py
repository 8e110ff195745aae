"""Answers of LeRobot's policy server act in the iterations that they are for, however late."""

import itertools
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from lerobot.async_inference.configs import RobotClientConfig
from starting import Start

import o80
from lerobot_robot_o80 import O80Config
from measure_lerobot import FPS, ROWS, serving

if TYPE_CHECKING:
    from lerobot_robot_o80.chunks import ChunkClient

pytestmark = pytest.mark.check


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """LeRobot writes a folder `logs` where it is imported."""
    monkeypatch.chdir(tmp_path)


def play(segment: str, address: str, until: "Callable[[ChunkClient], bool]") -> "ChunkClient":
    """Runs a client until the condition holds or it fails. Raises what its loop raises."""
    from lerobot_robot_o80.chunks import ChunkClient

    client = ChunkClient(
        RobotClientConfig(
            policy_type="act",
            pretrained_name_or_path="none",
            robot=O80Config(segment=segment, timeout=60.0),
            actions_per_chunk=ROWS,
            server_address=address,
            fps=FPS,
        )
    )
    receiver = threading.Thread(target=client.receive_actions)
    watcher = threading.Thread(target=stop_when, args=(client, until))
    try:
        assert client.start()
        receiver.start()
        watcher.start()
        client.control_loop("")
    finally:
        client.shutdown_event.set()
        receiver.join()
        watcher.join()
        client.stop()
    return client


def stop_when(client: "ChunkClient", until: "Callable[[ChunkClient], bool]") -> None:
    while client.running and not until(client):
        time.sleep(0.01)
    client.shutdown_event.set()


def test_each_action_acts_in_its_iteration_however_late_the_answer_comes(start: Start) -> None:
    segment = start("so101_twin")
    with serving(latency=0.15, jitter=0.6) as address, o80.Frontend(segment) as arm:
        client = play(segment, address, lambda client: len(client.sent) >= 5)
        taken = [each for each in client.sent if each.begins is not None]
        taken[-1].wait(60.0)
        rows = arm.history(since=0)
        assert rows.iteration[0] == 0
        commands = [
            command
            for entry in arm.journal()
            for command in entry.commands
            if command.pace == "chunk" and entry.kind == "taken"
        ]
    assert len(taken) >= 4
    compared = 0
    places = np.degrees(rows.desired.joints[:, 0])
    for chunk, following, command in zip(taken, taken[1:], commands, strict=False):
        first, shift, begins, end = chunk.first, chunk.shift, chunk.begins, following.begins
        assert first is not None
        assert shift is not None
        assert begins is not None
        assert end is not None
        limited = np.flatnonzero(rows.clamped[begins:end, 0])
        settled = begins + (30 + limited.max() if len(limited) else 0)  # on its rows again
        reached = zip(command.due, command.targets[0], strict=True)
        for due, row in itertools.islice(reached, first, None):
            if settled <= due + shift < end:
                assert places[due + shift] == pytest.approx(np.degrees(row), abs=1e-3)
                compared += 1
    assert compared >= 10


def test_a_halt_ends_the_client_with_its_text(start: Start) -> None:
    segment = start("so101_twin")
    with serving(latency=0.02, jitter=0.5) as address, o80.Frontend(segment) as arm:

        def halt(client: "ChunkClient") -> bool:
            if client.sent:
                arm.halt("a hand in the way")
            return False

        with pytest.raises(o80.BackendHalted, match="a hand in the way"):
            play(segment, address, halt)
