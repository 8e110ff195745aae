"""Mirror a real-time robot in a simulation that steps once for each of its rows."""

import numpy as np

import o80

robot = o80.robots.load("two_joints")
with robot.start(frequency=200, segment="real") as process, robot.inline(frequency=200) as twin:
    real = process.frontend()
    real.add_command("shoulder", 0.8, duration=0.5, profile="minimum_jerk")
    real.pulse()
    difference = 0.0
    for observation in real.stream():
        for joint, angle in enumerate(observation.observed):
            twin.add_command(joint, angle)
        mirrored = twin.burst(1)
        difference = max(difference, np.abs(mirrored.desired - observation.observed).max())
        if mirrored.iteration >= 150:
            break
    print(f"150 iterations mirrored, asked for exactly what was seen: {difference == 0.0}")
    real.close()
