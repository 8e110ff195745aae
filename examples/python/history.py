"""Read back every iteration, as one array for each field."""

import numpy as np

import o80

with o80.robots.load("two_joints").inline(frequency=1000, history=5000) as arm:
    arm.add_command("shoulder", 1.0, duration=1.0, profile="minimum_jerk")
    arm.add_command("elbow", -1.0, speed=2.0)
    arm.burst(1200)

    last = arm.history(1000)
    print(f"{len(last)} rows, observed is an array of shape {last.observed.shape}")
    lag = np.abs(last.desired - last.observed).max(axis=0)
    print(f"largest lag: shoulder {lag[0]:.3f} rad, elbow {lag[1]:.3f} rad")

    part = arm.history(since=100, until=200)
    print(
        f"rows {part.iteration[0]} to {part.iteration[-1]} lie "
        f"{(part.time[-1] - part.time[0]) * 1e-9:.3f} s apart"
    )
    busy = np.flatnonzero(last.active[:, 0])
    print(f"the shoulder moved in {len(busy)} of them")
