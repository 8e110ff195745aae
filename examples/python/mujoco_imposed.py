"""Impose the joint positions of a MuJoCo model: a paddle that hits a ball."""

from pathlib import Path

import o80

MODEL = Path(__file__).parent / "models" / "paddle.xml"

with o80.robots.load("mujoco").inline(
    model=MODEL,
    balls="ball",
    surfaces="blade=0.8, floor=0.7 0.7 0.75",
    watched="blade",
) as robot:
    # the ball stays at its commanded position as long as the command is active
    robot.add_command("ball", {"position": [0.0, 0.0, 1.2], "velocity": [0.0, 0.0, 0.0]})
    robot.burst(1)
    # the paddle hits the falling ball
    robot.add_command("lift", {"position": 0.2, "velocity": 0.0}, duration=0.3)
    observation = robot.burst(1000)

    blade = observation.extended["contacts"][0]["blade"]
    print(f"met the paddle at iteration {blade['iteration']}, and again: {blade['count'] > 1}")
    down, up = -blade["velocity_before"][2], blade["velocity_after"][2]
    print(f"rose again at {up:.2f} m/s after falling at {down:.2f} m/s")
