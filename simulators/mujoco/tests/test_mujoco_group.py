"""Copies of a MuJoCo model in an inline group do what single ones do, bit for bit."""

from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

import o80

MODEL = Path(__file__).parent / "models" / "pendulum.xml"
COPIES = 3


@pytest.mark.parametrize("threads", [1, 2])
def test_a_group_of_simulations_gives_the_rows_of_single_ones(threads: int) -> None:
    random = np.random.default_rng(5)
    robot = o80.robots.load("mujoco")
    with ExitStack() as stack:
        singles = [stack.enter_context(robot.inline(model=MODEL)) for _ in range(COPIES)]
        group = stack.enter_context(robot.inline(copies=COPIES, threads=threads, model=MODEL))
        burst = group.prepared_burst(8)
        bursts = [single.prepared_burst(8) for single in singles]
        for turn in range(12):
            burst.targets["position"][...] = random.uniform(-0.5, 0.5, burst.targets.shape)
            burst.targets["velocity"][...] = random.uniform(-1, 1, burst.targets.shape)
            burst.run()
            for i, one in enumerate(bursts):
                one.targets = burst.targets[i]
                one.run()
                assert burst.rows[i].tobytes() == one.rows.tobytes()
            if turn % 3 == 1:
                group.request("snapshot", copies=[0, 1], slot=1)
                for single in singles[:2]:
                    single.request("snapshot", slot=1)
            if turn % 3 == 2:
                group.request("restore", copies=[1], slot=1)
                singles[1].request("restore", slot=1)
                group.request("reset", copies=[2], seed=turn)
                singles[2].request("reset", seed=turn)
