"""Shows a robot in the browser while this program moves it.

Prints the address of the page. The 3D part needs the extra `view` (pip install "o80[view]").
"""

import sys

import o80

SECONDS = float(sys.argv[1]) if len(sys.argv) > 1 else 1.0  # give a longer time to watch

with (
    o80.robots.load("two_joints").start(frequency=500) as process,
    o80.View(process.segment) as view,
):
    print(f"open {view.url}")
    with process.frontend() as arm:
        for target in (1.0, -1.0, 0.0):
            arm.add_command("shoulder", target, duration=SECONDS / 3, profile="minimum_jerk")
            arm.add_command("elbow", -target, duration=SECONDS / 3, profile="minimum_jerk")
        print(arm.pulse_and_wait(timeout=SECONDS + 60.0).observed)
