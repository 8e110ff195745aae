"""Wait for a pulse, or poll its status later."""

import o80

with o80.robots.load("two_joints").start(frequency=500) as process:
    arm = process.frontend()

    # blocking: returns the row in which the last command ended
    arm.add_command("elbow", 0.3, duration=0.2)
    observation = arm.pulse_and_wait(timeout=10.0)
    print(f"asked for {observation.desired[1]:.2f} rad, at {observation.observed[1]:.2f} rad")

    # not blocking: the batch has the statuses of its commands
    arm.add_command("elbow", 0.0, duration=0.2)
    batch = arm.pulse()
    thought = sum(i * i for i in range(1000))
    batch.wait(timeout=10.0)
    print(
        f"thought of {thought} while iterations {batch.first_iteration} to "
        f"{batch.last_iteration} went by"
    )

    # following the loop: the observation ten iterations later, and the next one
    later = arm.wait_for(batch.last_iteration + 10, timeout=10.0)
    following = arm.wait_for_next(timeout=10.0)
    print(f"row {later.iteration} came in its time, row {following.iteration} is next")
    arm.close()
