"""Draw pictures of what a MuJoCo robot did, from its history.

Needs `pip install "o80-mujoco[rendering]"`, and EGL or OSMesa (Debian: libegl1 or libosmesa6).
"""

import os
from pathlib import Path

os.environ.setdefault("MUJOCO_GL", "egl")  # no screen is needed; or "osmesa"

import mujoco
import numpy as np

import o80

MODEL = Path(__file__).parent / "models" / "cart_pole.xml"

with o80.robots.load("mujoco").inline(model=MODEL) as robot:
    robot.add_command("slide", {"position": 0.5}, duration=1.0, profile="minimum_jerk")
    robot.add_command("hinge", {"position": 0.6}, duration=1.0)
    last = robot.burst(500).iteration
    rows = robot.history(since=0, until=last)

# the same model again, with the positions of the rows
model = mujoco.MjModel.from_xml_path(str(MODEL))
data = mujoco.MjData(model)
places = [int(model.joint(actuator.name).qposadr[0]) for actuator in robot.actuators]
with mujoco.Renderer(model, height=240, width=320) as renderer:
    pictures = []
    for row in rows.observed.joints["position"][::100]:
        data.qpos[places] = row
        mujoco.mj_forward(model, data)
        renderer.update_scene(data, camera="side")
        pictures.append(renderer.render())
film = np.stack(pictures)
print(f"{len(film)} pictures of shape {film.shape[1:]}")
print("they differ:", bool((film[0] != film[-1]).any()))
