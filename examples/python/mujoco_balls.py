"""Let balls fly and bounce in a MuJoCo model: down a staircase, one of them with backspin."""

from pathlib import Path

import o80

MODEL = Path(__file__).parent / "models" / "staircase.xml"
STEPS = ["step_1", "step_2", "step_3"]

for spin in (0.0, -100.0):
    with o80.robots.load("mujoco").inline(
        model=MODEL,
        balls="ball",
        surfaces=[*STEPS, "floor"],
        restitution=(0.9, 0.9, 0.8),
        spin=(0.0, spin, 0.0),  # [rad/s], about the y axis
    ) as robot:
        # one command throws the ball: after it, the ball flies freely
        robot.add_command("ball", {"position": [0.0, 0.0, 1.2], "velocity": [1.2, 0.0, 0.5]})
        observation = robot.burst(1500)  # 3 s

    contacts = observation.extended["contacts"][0]
    bounces = {name: int(contacts[name]["count"]) for name in STEPS}
    print(f"spin {spin:g} rad/s: bounces {bounces}")
    x = contacts["floor"]["position"][0]
    print(f"first on the floor at x = {x:.2f} m, iteration {contacts['floor']['iteration']}")
