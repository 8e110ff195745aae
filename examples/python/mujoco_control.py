"""Command the motor of a MuJoCo model: a cart that balances its pole."""

from pathlib import Path

import numpy as np

import o80

MODEL = Path(__file__).parent / "models" / "cart_pole.xml"
GAINS = np.array([9.8, 56.4, 10.6, 11.4])  # of slide, hinge and their velocities

with o80.robots.load("mujoco").inline(model=MODEL, mode="control") as robot:
    print(f"{robot.frequency:g} Hz, as the model says; actuators: {robot.actuators[0].name}")
    observation = robot.latest()
    for step in range(1000):
        joints = observation.extended["joints"]
        state = np.concatenate([joints["position"], joints["velocity"]])
        nudge = 3.0 if step < 10 else 0.0
        robot.add_command("push", float(np.clip(GAINS @ state + nudge, -20, 20)))
        observation = robot.burst(1)
    angle = observation.extended["joints"]["position"][1]
    print(f"after 2 s the pole stands: {abs(angle) < 0.02}")

with o80.robots.load("mujoco").inline(model=MODEL, mode="control", frequency=100) as robot:
    print(f"{robot.frequency:g} Hz: five steps of the model in each iteration")
