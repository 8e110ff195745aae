"""Copies of a MuJoCo model in an inline group do what single ones do, bit for bit."""

from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import o80

MODEL = Path(__file__).parent / "models" / "pendulum.xml"
COURT = Path(__file__).parent / "models" / "court.xml"
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


def test_a_burst_sends_targets_to_joints_and_to_a_ball_at_once() -> None:
    options: dict[str, Any] = {"model": COURT, "balls": "ball"}
    robot = o80.robots.load("mujoco")
    with robot.inline(copies=COPIES, threads=2, **options) as group, ExitStack() as stack:
        singles = [stack.enter_context(robot.inline(**options)) for _ in range(COPIES)]
        burst = group.prepared_burst(6, steps=2)
        names = [actuator.name for actuator in group[0].actuators]
        assert burst.targets.shape == (COPIES,)
        assert burst.targets.dtype.names == tuple(names)
        with pytest.raises(o80.CopyFailed, match="not a finite number"):
            burst.run()
        random = np.random.default_rng(4)
        numbers = burst.targets.view(np.float64)
        numbers[...] = random.uniform(0.2, 0.4, numbers.shape)
        burst.run()
        for copy, single in enumerate(singles):
            for name in names:
                for target in burst.targets[name][copy]:
                    single.add_command(name, target)
            single.burst(6)
            assert burst.rows[copy].tobytes() == single.history(6).rows.tobytes()
        again = burst.targets.copy()
        again["ball"]["position"] += 0.1
        burst.targets = again
        burst.run([1])
        assert (burst.rows["observed"]["balls"][1] != burst.rows["observed"]["balls"][0]).any()
        with pytest.raises(o80.InvalidArgument, match=r"shape \(copies,\)"):
            burst.targets = again[:2]
        with pytest.raises(o80.InvalidArgument, match="targets of one type"):
            group.prepared_burst(2).then(burst, "observed")
