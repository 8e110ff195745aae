"""Queue commands one after the other; overwrite drops the running and the queued ones."""

import o80

with o80.robots.load("two_joints").start(frequency=500) as process:
    arm = process.frontend()

    # queued: shoulder up and back, without an idle iteration between
    arm.add_command("shoulder", 0.5, duration=0.2)
    arm.add_command("shoulder", 0.0, duration=0.2)
    there_and_back = arm.pulse_and_wait(timeout=10.0)
    print(f"there and back by iteration {there_and_back.iteration}")

    # overwriting: the slow motion is dropped before its end
    arm.add_command("shoulder", 1.0, duration=60.0)
    slow = arm.pulse()
    arm.add_command("shoulder", 0.1, duration=0.1, mode="overwrite")
    arm.pulse_and_wait(timeout=10.0)
    print(f"the slow command was {slow.statuses[0].name.lower()}")

    # purging: no command is left, and the arm holds its position
    arm.add_command("shoulder", 2.0, duration=60.0)
    dropped = arm.pulse()
    arm.purge()
    dropped.wait(timeout=10.0, check=False)  # without it, the purge raises o80.NotCompleted
    print(f"the last one was {dropped.statuses[0].name.lower()}")
    arm.close()
