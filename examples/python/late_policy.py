"""A learned policy answers with 16 actions, 150 ms late, while the arm moves.

A small network imitates a teacher that follows a circle. An answer takes longer than a period of
50 Hz: it is computed from an observation 75 iterations ago. Its rows are for fixed iterations:
late rows are skipped, and all others are executed in their own iterations.
"""

import time

import numpy as np
from numpy.typing import NDArray

import o80

Places = NDArray[np.float64]

ACTIONS = 16
STEP = 10  # iterations from action to action: 50 actions a second at 500 Hz
RADIUS, TURN = 0.4, 2.0  # [rad], [rad/s]
THINKS = 0.15  # [s]


def teacher(places: Places) -> Places:
    """Returns the next actions (n, actions, 2) from places (n, 2): to the circle, and along it."""
    angle, radius = np.arctan2(places[:, 1], places[:, 0]), np.hypot(*places.T)
    ahead = np.arange(1, ACTIONS + 1)
    angles = angle[:, None] + TURN * STEP / 500 * ahead
    radii = RADIUS + (radius[:, None] - RADIUS) * np.exp(-ahead / 8)
    return np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=-1)


class Network:
    """One hidden layer with random weights; the last layer is fitted to the teacher."""

    def __init__(self, seed: int = 0) -> None:
        random = np.random.default_rng(seed)
        self.inner = random.normal(0, 3, (2, 200)), random.uniform(-2, 2, 200)
        angles, radii = random.uniform(-np.pi, np.pi, 5000), random.uniform(0.2, 0.6, 5000)
        seen = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)
        self.outer = np.linalg.lstsq(self.hidden(seen), teacher(seen).reshape(5000, -1))[0]

    def hidden(self, seen: Places) -> Places:
        hidden: Places = np.tanh(seen @ self.inner[0] + self.inner[1])
        return hidden

    def __call__(self, seen: Places) -> Places:
        time.sleep(THINKS)  # as slow as a large network
        actions: Places = self.hidden(seen[None]) @ self.outer
        return actions.reshape(ACTIONS, 2)


policy = Network()
with (
    o80.robots.load("two_joints").start(frequency=500) as process,
    process.frontend() as arm,
):
    arm.move_to(None, [RADIUS, 0.0], tolerance=0.01, duration=0.5)
    began = arm.published
    for name, ensemble in {"replaced": None, "mixed as ACT does": 0.1}.items():
        with arm.chunks(step=STEP, ensemble=ensemble) as plan:
            answers = []
            for _ in range(10):
                seen = plan.wait(lead=100, grid=True)  # 0.2 s are left for the next answer
                answers.append(plan.send(policy(seen.desired), seen=seen))
            plan.wait()
        print(f"{name}: {sum(each.late or 0 for each in answers)} late rows were skipped")
    desired = arm.history(arm.published - began).desired
    radii, steps = np.hypot(*desired.T), np.diff(desired, axis=0)
    print(f"on the circle: {np.abs(radii - RADIUS).max() < 0.05}")
    print(f"no jump: {np.abs(steps).max() < 3 * RADIUS * TURN / 500}")
