"""A policy learns on the simulated SO-101 and moves the arm, here with fake servos: same code.

Task: bring the tip of the gripper within 10 mm of a point in front of the arm in a second, and
keep it there for half a second. The policy observes joint positions and the point, and returns
the next 16 set-points, 50 a second. It learns from simulated motions: each one demonstrates the
way to its own end point.
"""

import argparse
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

import o80
from o80_arms import fakes

Array = NDArray[np.float64]

JOINTS = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex"]  # the first four of the arm
HOME = [0.0, -0.6, 0.4, 0.9, 0.0, 0.2]  # of all actuators
RATE, STEP, ROWS = 150, 3, 16  # iterations a second, iterations a row, rows of an answer
LOW, HIGH = np.array([0.18, -0.12, 0.08]), np.array([0.30, 0.12, 0.20])  # bounds of the points [m]
NEAR = 0.01  # [m]
TRY, LAST = 225, 75  # iterations of a try; at its end those with the tip near


class Tip:
    """Computes the place of the gripper's tip from the arm's model [m]."""

    def __init__(self, twin: o80.robots.Robot) -> None:
        self._model = mujoco.MjModel.from_xml_path(twin.describe()["model"]["file"])
        self._data = mujoco.MjData(self._model)
        self._at = [self._model.joint(joint).qposadr[0] for joint in JOINTS]

    def __call__(self, joints: Array) -> Array:
        """Returns the places for joint positions: (n, joints) => (n, 3)."""
        places = np.empty((len(joints), 3))
        for place, row in zip(places, joints, strict=True):
            self._data.qpos[self._at] = row[: len(JOINTS)]
            mujoco.mj_kinematics(self._model, self._data)
            place[:] = self._data.site("gripperframe").xpos
        return places


def postures(tip: Tip, random: np.random.Generator, count: int) -> Array:
    """Draws joint positions with the gripper downwards and the tip within the bounds."""
    found = np.empty((0, len(JOINTS)))
    while len(found) < count:
        drawn = random.uniform([-0.9, -1.6, -1.3], [0.9, 0.7, 1.5], (4000, 3))
        drawn = np.column_stack([drawn, 0.7 - drawn[:, 1] - drawn[:, 2]])
        drawn = drawn[np.abs(drawn[:, 3]) < 1.5]
        places = tip(drawn)
        inside = (places > LOW - 0.02) & (places < HIGH + 0.02)
        found = np.vstack([found, drawn[inside.all(axis=1)]])
    return found[:count]


def demonstrations(
    twin: o80.robots.Robot, tip: Tip, random: np.random.Generator, motions: int
) -> tuple[Array, Array]:
    """Draws eight moments of each motion: observation and end point, and the following rows."""
    seen, answers = [], []
    with twin.inline(copies=8, history=256) as copies:
        burst = copies.prepared_burst(200, JOINTS)
        for goals in postures(tip, random, motions // 8 * 8).reshape(-1, 8, len(JOINTS)):
            burst.targets[:, 0] = goals
            burst.run()
            observed = burst.rows["observed"]["joints"][..., : len(JOINTS)]
            desired = burst.rows["desired"]["joints"][..., : len(JOINTS)]
            for copy, end in enumerate(tip(observed[:, -1])):
                for moment in (199 * random.uniform(0, 1, 8) ** 2).astype(int):  # most are early
                    ahead = np.minimum(moment + STEP * np.arange(1, ROWS + 1), 199)
                    seen.append(np.concatenate([observed[copy, moment], end]))
                    answers.append(desired[copy, ahead] - observed[copy, moment])
    return np.array(seen), np.array(answers).reshape(len(answers), -1)


@dataclass
class Policy:
    """One hidden layer with random weights; the last layer is fitted to the demonstrations."""

    inner: Array
    bias: Array
    outer: Array
    low: Array  # range of demonstrated positions
    high: Array

    @classmethod
    def fitted(cls, seen: Array, answers: Array, random: np.random.Generator) -> "Policy":
        inner = random.normal(0, 0.2, (seen.shape[1], 1000)) / seen.std(axis=0)[:, None]
        bias = random.uniform(-1.5, 1.5, 1000) - seen.mean(axis=0) @ inner
        hidden = np.tanh(seen @ inner + bias)
        square = hidden.T @ hidden + 1e-4 * np.eye(1000)
        outer = np.asarray(np.linalg.solve(square, hidden.T @ answers), np.float64)
        joints = seen[:, : len(JOINTS)]
        return cls(inner, bias, outer, joints.min(axis=0), joints.max(axis=0))

    def __call__(self, joints: Array, goal: Array) -> Array:
        """Next set-points (rows, joints), clamped to the demonstrated range."""
        joints = joints[: len(JOINTS)]
        hidden = np.tanh(np.concatenate([joints, goal]) @ self.inner + self.bias)
        rows: Array = joints + (hidden @ self.outer).reshape(ROWS, len(JOINTS))
        return rows.clip(self.low, self.high)


def play(arm: o80.Frontend, policy: Policy, goals: Array, tip: Tip) -> Array:
    """Runs a try for each goal; returns its largest final distance of the tip [m]."""
    arm.add_command(None, HOME, duration=3.0)
    arm.pulse_and_wait(timeout=20.0)
    apart = []
    with arm.chunks(JOINTS, step=STEP) as plan:
        for goal in goals:
            end = arm.published + TRY
            while (seen := plan.wait(lead=24)).iteration < end:  # 0.16 s are planned
                plan.send(policy(seen.observed.joints, goal), seen=seen)
            places = tip(arm.history(LAST).observed["joints"])
            apart.append(np.linalg.norm(places - goal, axis=1).max())
    return np.array(apart)


@contextmanager
def running(name: str, options: dict[str, Any], bursting: bool) -> Iterator[o80.Frontend]:
    robot = o80.robots.load(name)
    if bursting:
        with robot.inline(**options) as arm:
            yield arm
    else:
        with robot.start(**options) as process, process.frontend() as arm:
            yield arm


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--motions", type=int, default=1600, help="to learn from")
    parser.add_argument("--tries", type=int, default=40)
    parser.add_argument("--bursting", action="store_true", help="as fast as it goes")
    words = parser.parse_args()

    began = time.monotonic()
    random = np.random.default_rng(1)
    twin = o80.robots.load("so101_twin")
    tip = Tip(twin)
    seen, answers = demonstrations(twin, tip, random, words.motions)
    np.savez("reach.npz", **vars(Policy.fitted(seen, answers, random)))
    print(f"learned from {words.motions} motions in {time.monotonic() - began:.0f} s: reach.npz")

    policy = Policy(**np.load("reach.npz"))
    goals = random.uniform(LOW, HIGH, (words.tries, 3))
    with fakes.so101(tick=1 / RATE if words.bursting else None) as fake:
        for name, options in {"so101_twin": {}, "so101": fake.options}.items():
            with running(name, options, words.bursting) as arm:
                apart = play(arm, policy, goals, tip)
            there = f"{(apart < NEAR).sum()} of {len(apart)} tries"
            print(f"{name}: {there}, {1000 * np.median(apart):.1f} mm in the median")


if __name__ == "__main__":
    main()
