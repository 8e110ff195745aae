"""Moves the tool of an arm in a circle: inverse kinematics on a model, sent in chunks.

The arm is a MuJoCo model, or with --twin the simulated SO-101; a real arm takes the same rows.
"""

import argparse
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

import o80

MODEL = Path(__file__).parent / "models" / "three_joints.xml"
AHEAD, TURN, RADIUS = np.arange(1, 26) / 25, 4.0, 0.04  # a chunk's times [s], period [s], [m]


class Tool:
    """Site of a model, and the joints that move the site."""

    def __init__(self, file: str, site: str, joints: list[str]) -> None:
        self._model = model = mujoco.MjModel.from_xml_path(file)
        self._data, self._site = mujoco.MjData(model), model.site(site).id
        self._at = [model.joint(each).qposadr[0] for each in joints]
        self._moves = [model.joint(each).dofadr[0] for each in joints]
        self._low, self._high = model.jnt_range[[model.joint(each).id for each in joints]].T

    def place(self, joints: np.ndarray) -> np.ndarray:
        """Place of the site for these joint positions [m]."""
        self._data.qpos[self._at] = joints
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        return np.array(self._data.site_xpos[self._site])

    def joints_for(self, places: np.ndarray, joints: np.ndarray) -> np.ndarray:
        """Joint positions (n, joints) for places (n, 3), each near the last, first `joints`."""
        rows, jacobian = np.empty((len(places), len(joints))), np.zeros((3, self._model.nv))
        for row, goal in zip(rows, places, strict=True):
            for _ in range(20):
                away = goal - self.place(joints)
                mujoco.mj_jacSite(self._model, self._data, jacobian, None, self._site)
                moves = jacobian[:, self._moves]
                damped = moves @ moves.T + 1e-6 * np.eye(3)  # damped against singularities
                joints = joints + moves.T @ np.linalg.solve(damped, away)
                joints = np.clip(joints, self._low, self._high)
            row[:] = joints
        return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--twin", action="store_true", help="the simulated SO-101")
    robot, options = o80.robots.load("mujoco"), dict[str, Any](model=MODEL, mode="actuated")
    site, joints, home = "tool", ["turn", "shoulder", "elbow"], np.array([0.0, -0.5, 1.2])
    if parser.parse_args().twin:
        robot, options = o80.robots.load("so101_twin"), {}
        site, joints = "gripperframe", ["shoulder_pan", "shoulder_lift", "elbow_flex"]
        home = np.array([0.0, -0.6, 0.4])
    with robot.inline(**options, history=4096) as arm:
        tool = Tool(robot.describe(**options)["model"]["file"], site, joints)
        arm.add_command(joints, home.tolist(), duration=2.0)
        arm.pulse_and_wait(timeout=30.0)
        begin, center = arm.published, tool.place(home) - [0.0, 0.0, RADIUS]
        with arm.chunks(joints, step=AHEAD[0] / arm.period, clip=True) as plan:
            while (seen := plan.wait(lead=0.5)).iteration < begin + 2 * TURN / arm.period:
                at = [*plan.planned(seen, 1), home][0]  # next positions of the arm
                turned = ((seen.iteration - begin) * arm.period + AHEAD) * 2 * np.pi / TURN
                turned -= np.sin(np.minimum(turned, np.pi))  # from rest
                circle = np.column_stack([0 * turned, np.sin(turned), np.cos(turned)])
                plan.send(tool.joints_for(center + RADIUS * circle, at), seen=seen)
        turn = arm.history()[-int(TURN / arm.period) :]
        for part in ("desired", "observed"):
            rows = np.column_stack([turn[f"{part}.{each}"] for each in joints])
            away = np.linalg.norm([tool.place(row) - center for row in rows], axis=1) - RADIUS
            print(f"{robot.name}: {part} at most {1000 * np.abs(away).max():.2f} mm off the circle")


if __name__ == "__main__":
    main()
