"""Draw pictures of a MuJoCo robot's motion from its history.

Needs `pip install "o80[rendering]"`, and EGL or OSMesa (Debian: libegl1 or libosmesa6).
"""

from pathlib import Path

import numpy as np

import o80

MODEL = Path(__file__).parent / "models" / "cart_pole.xml"

with (
    o80.robots.load("mujoco").inline(model=MODEL) as robot,
    o80.Pictures(robot, size=(320, 240), camera="side") as pictures,
):
    robot.add_command("slide", {"position": 0.5}, duration=1.0, profile="minimum_jerk")
    robot.add_command("hinge", {"position": 0.6}, duration=1.0)
    last = robot.burst(500).iteration
    rows = robot.history(since=0, until=last)
    film = np.stack([pictures.draw(row) for row in rows[::100]])
print(f"{len(film)} pictures of shape {film.shape[1:]}")
print("they differ:", bool((film[0] != film[-1]).any()))
