"""The tool of an arm goes round a circle: inverse kinematics, sent by chunks.

Positions of the tool become joint positions by the Jacobian of the model, one row after the other.
The arm is a MuJoCo model, or with --twin the simulated SO-101; a real arm takes the same rows.
"""

import argparse
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

import o80

Array = NDArray[np.float64]

MODEL = Path(__file__).parent / "models" / "three_joints.xml"
RATE, ROWS, TURN = 25, 25, 4.0  # rows a second; of a chunk; time of a turn [s]
RADIUS = 0.04  # [m]


class Tool:
    """A site of a model whose joints move it."""

    def __init__(self, model: mujoco.MjModel, site: str, joints: list[str]) -> None:
        self._model, self._data, self._site = model, mujoco.MjData(model), model.site(site).id
        self._joints = joints
        self._at = [model.joint(each).qposadr[0] for each in joints]
        self._moves = [model.joint(each).dofadr[0] for each in joints]
        self._low, self._high = model.jnt_range[[model.joint(each).id for each in joints]].T

    def place(self, joints: Array) -> Array:
        """Where it is with these joint positions [m]."""
        self._data.qpos[self._at] = joints
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        return np.array(self._data.site_xpos[self._site])

    def joints_for(self, places: Array, joints: Array) -> Array:
        """Joint positions (n, joints) for places (n, 3), each near those before, first `joints`."""
        rows, jacobian = np.empty((len(places), len(joints))), np.zeros((3, self._model.nv))
        for row, goal in zip(rows, places, strict=True):
            for _ in range(20):
                away = goal - self.place(joints)
                mujoco.mj_jacSite(self._model, self._data, jacobian, None, self._site)
                moves = jacobian[:, self._moves]
                damped = moves @ moves.T + 1e-6 * np.eye(3)  # where it is singular, too
                joints = joints + moves.T @ np.linalg.solve(damped, away)
                joints = np.clip(joints, self._low, self._high)
            row[:] = joints
        return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--twin", action="store_true", help="the simulated SO-101")
    options: dict[str, Any] = {}
    if parser.parse_args().twin:
        robot = o80.robots.load("so101_twin")
        site, joints = "gripperframe", ["shoulder_pan", "shoulder_lift", "elbow_flex"]
        model = mujoco.MjModel.from_xml_path(robot.describe()["model"]["file"])
        home = np.array([0.0, -0.6, 0.4])
    else:
        robot, options = o80.robots.load("mujoco"), {"model": MODEL, "mode": "actuated"}
        site, joints = "tool", ["turn", "shoulder", "elbow"]
        model = mujoco.MjModel.from_xml_path(str(MODEL))
        home = np.array([0.0, -0.5, 1.2])
    tool = Tool(model, site, joints)
    with robot.inline(**options, history=4096) as arm:
        arm.add_command(joints, home.tolist(), duration=2.0)
        arm.pulse_and_wait(timeout=30.0)
        begin, center = arm.published, tool.place(home) - [0.0, 0.0, RADIUS]
        step = 1 / arm.period / RATE
        with arm.chunks(joints, step=step, clip=True) as plan:
            while (seen := plan.wait(lead=0.5)).iteration < begin + 2 * TURN / arm.period:
                prefix = plan.planned(seen, 1)  # the inverse begins where the arm will be
                at = prefix[0] if len(prefix) else home
                times = (seen.iteration - begin) * arm.period + np.arange(1, ROWS + 1) / RATE
                turned = 2 * np.pi * times / TURN
                turned -= np.sin(np.minimum(turned, np.pi))  # from rest
                circle = np.column_stack([0 * turned, np.sin(turned), np.cos(turned)])
                plan.send(tool.joints_for(center + RADIUS * circle, at), seen=seen)
        turn = arm.history()[-int(TURN / arm.period) :]
        off = []
        for part in ("desired", "observed"):
            rows = np.column_stack([turn[f"{part}.{each}"] for each in joints])
            away = np.linalg.norm([tool.place(row) - center for row in rows], axis=1) - RADIUS
            off.append(f"{part} at most {1000 * np.abs(away).max():.2f} mm")
        print(f"{robot.name}: {', '.join(off)} off the circle")


if __name__ == "__main__":
    main()
