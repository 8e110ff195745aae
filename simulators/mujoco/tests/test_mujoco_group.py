"""Copies of a MuJoCo model in an inline group do what single ones do, bit for bit."""

from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import o80

COURT = Path(__file__).parent / "models" / "court.xml"
COPIES = 3


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
