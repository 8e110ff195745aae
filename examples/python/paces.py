"""Send commands with every pace: at once, duration, speed, until an iteration, iterations."""

from typing import Any

import o80

with o80.robots.load("two_joints").inline(frequency=1000) as arm:

    def took(**pace: Any) -> int:
        """Counts the iterations of a command to 1 rad, and returns to 0 at once."""
        arm.add_command("shoulder", 1.0, **pace)
        batch = arm.pulse()
        while not batch.ended:
            arm.burst(1)
        iterations = batch.last_iteration - batch.first_iteration + 1
        arm.add_command("shoulder", 0.0)
        arm.burst(1)
        return iterations

    print(f"at once:              {took()} iteration")
    print(f"in 0.25 s:            {took(duration=0.25)} iterations")
    print(f"at 10 rad/s:          {took(speed=10.0)} iterations")
    print(f"in 40 iterations:     {took(iterations=40)} iterations")
    print(f"by an iteration:      {took(until=arm.published + 30)} iterations")
    print(f"smoothly at 10 rad/s: {took(speed=10.0, profile='minimum_jerk')} iterations")
