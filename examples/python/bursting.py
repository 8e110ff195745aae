"""Step a simulator from a learner: in a process of its own, in this process, and in groups."""

import numpy as np

import o80

robot = o80.robots.load("two_joints")

# in a process of its own: one call, one wake-up each way
with robot.start(bursting=True, segment="simulation") as process:
    simulation = process.frontend()
    simulation.add_command("elbow", 1.0, iterations=10)
    separate = simulation.burst(10)
    simulation.close()

# inline: the same robot in this process, its iterations run in this thread
with robot.inline() as simulation:
    simulation.add_command("elbow", 1.0, iterations=10)
    inside = simulation.burst(10)
print("the same to the last bit:", np.array_equal(separate.observed, inside.observed))

# a group: starts all bursts first, then waits for all
with (
    robot.start(bursting=True, segment="left") as a,
    robot.start(bursting=True, segment="right") as b,
):
    left, right = a.frontend(), b.frontend()
    rows = o80.burst({left: 5, right: 3})
    print(f"left is at iteration {rows[left].iteration}, right at {rows[right].iteration}")
    left.close()
    right.close()
