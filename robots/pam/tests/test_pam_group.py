"""Copies of the arm in an inline group do what single arms do, bit for bit."""

from contextlib import ExitStack

import numpy as np
import pytest

import o80

COPIES = 3


@pytest.mark.parametrize("threads", [1, 2])
def test_a_group_of_arms_gives_the_rows_of_single_arms(threads: int) -> None:
    random = np.random.default_rng(4)
    robot = o80.robots.load("pam")
    with ExitStack() as stack:
        singles = [stack.enter_context(robot.inline(start_noise=0.01)) for _ in range(COPIES)]
        group = stack.enter_context(robot.inline(copies=COPIES, threads=threads, start_noise=0.01))
        burst = group.prepared_burst(10, steps=2, each=5)
        bursts = [single.prepared_burst(10, steps=2, each=5) for single in singles]
        middle = group.latest()["desired"].mean(axis=0)
        for turn in range(12):
            burst.targets = middle + random.integers(-900, 900, (COPIES, 2, len(middle)))
            burst.run()
            for i, one in enumerate(bursts):
                one.targets = burst.targets[i]
                one.run()
                assert burst.rows[i].tobytes() == one.rows.tobytes()
            if turn % 3 == 1:
                group.request("snapshot", copies=[0], slot=1)
                singles[0].request("snapshot", slot=1)
                group.request("reset", copies=[1, 2], seed=[turn, turn + 1])
                singles[1].request("reset", seed=turn)
                singles[2].request("reset", seed=turn + 1)
            if turn % 3 == 2:
                group.request("restore", copies=[0], slot=1)
                singles[0].request("restore", slot=1)
