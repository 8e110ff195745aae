"""Save a state of a simulator, continue, restore the state, and repeat the motion bit for bit."""

from typing import Any

import numpy as np

import o80

with o80.robots.load("two_joints").inline() as arm:

    def swing() -> Any:
        arm.add_command("shoulder", 1.0, iterations=50)
        arm.add_command("shoulder", 0.0, iterations=50)
        last = arm.burst(100).iteration
        return arm.history(since=last - 99, until=last).observed

    arm.request("reset", seed=1)
    arm.request("snapshot", slot=0)
    first = swing()
    arm.request("restore", slot=0)
    second = swing()
    print("the same to the last bit:", np.array_equal(first, second))

    try:
        arm.request("restore", slot=99)
    except o80.RequestRejected as error:
        print("refused:", error)
