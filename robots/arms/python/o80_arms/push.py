"""An SO-101 pushes a simulated puck: a task for training in simulation and for the real arm.

python -m o80.learning train o80_arms.push:Push --decisions 300000
"""

from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.spaces import Box

from o80.hybrid import HybridTask, Index, Mirror, Outcome, Rig

# three joints [rad] with the tip 20 mm above the floor, by the tip's distance to the base [m]
REACH = [0.17, 0.20, 0.23, 0.26, 0.29, 0.32, 0.35]
ARM = np.array(
    [
        [-1.025, -0.631, -0.331, -0.076, 0.162, 0.411, 0.729],
        [1.270, 1.071, 0.837, 0.573, 0.271, -0.093, -0.611],
        [0.955, 0.760, 0.694, 0.703, 0.767, 0.882, 1.082],
    ]
)
FORK = (1.57, 0.2)  # wrist turned, gripper opened a little: two fingers behind the puck
NEAR = 0.03  # [m]


class Push(HybridTask):
    """Push the puck to a place 8 to 11 cm away. Places on the floor are x + iy [m]."""

    rig = Rig(
        robot="so101_twin",
        world="so101_twin",
        things=Path(__file__).with_name("puck.xml"),
        mirror=Mirror(velocity="extended.measured.velocity", fresh="extended.link.fresh"),
        every=3,  # 50 actions a second
        delay=1,
    )
    action_space = Box(-1, 1, (2,), np.float32)  # of the fingers: to the goal, to the left
    world_numbers = ("tip", "puck_place", "puck_velocity")
    home = (0.0, *ARM[:, 0], *FORK)
    max_steps = 150
    displaced = 0.0  # distance by which the puck jumps in a random step [m]

    def prepare(self) -> None:
        self.asked, self.goal, self.way, self.jump = np.zeros((4, self.copies), complex)
        self.jumps_at, self.worth = np.zeros((2, self.copies))

    def begin(self, copies: Any, generators: Any, options: Any) -> None:
        low, high = [-0.5, 0.22, -0.4, 0.08, -np.pi, 10], [0.5, 0.24, 0.4, 0.11, np.pi, 60]
        drawn = np.array([each.uniform(low, high) for each in generators]).T
        puck = drawn[1] * np.exp(1j * drawn[0])
        self.goal[copies] = puck + drawn[3] * np.exp(1j * (drawn[0] + drawn[2]))
        self.jump[copies], self.jumps_at[copies] = np.exp(1j * drawn[4]), np.round(drawn[5])
        self.asked[copies], self.worth[copies] = REACH[0], np.nan
        self.place(copies, puck)

    def place(self, copies: Any, puck: Any) -> None:
        position = np.column_stack([puck.real, puck.imag, np.full(len(puck), 0.02)])
        self.world.request("place", copies, body="puck", position=position)

    def targets(self, actions: Any, copies: Index) -> Any:
        ahead, left = self.clipped(actions).T
        asked = self.asked[copies] + 0.004 * (ahead + 1j * left) * self.way[copies]
        turn, reach = np.clip(np.angle(asked), -1.2, 1.2), np.clip(abs(asked), 0.17, 0.35)
        self.asked[copies] = reach * np.exp(1j * turn)
        joints = [np.interp(reach, REACH, joint) for joint in ARM]
        return np.column_stack([-turn, *joints, *(np.full(len(turn), each) for each in FORK)])

    def measured(self, copies: Index) -> Any:
        return super().observe(copies)

    def seen(self, copies: Index) -> tuple[Any, ...]:
        x, y, _, puck_x, puck_y, _, speed_x, speed_y, _ = self.measured(copies).T
        fingers, puck = x + 1j * y, puck_x + 1j * puck_y
        fingers += 0.016j * np.exp(1j * np.angle(fingers))  # from the site to their middle
        return fingers, puck, speed_x + 1j * speed_y, self.goal[copies] - puck

    def observe(self, copies: Index) -> Any:
        fingers, puck, speed, far = self.seen(copies)
        self.way[copies] = way = np.exp(1j * np.angle(far))
        parts = [(fingers - puck) * 15, (self.asked[copies] - fingers) * 40, speed * 5, fingers * 3]
        ahead = np.array([*parts, far * 10]) / way
        return np.vstack([ahead.real, ahead[:-1].imag]).T.astype(np.float32)

    def judge(self, copies: Any) -> Outcome:
        fingers, puck, speed, far = self.seen(copies)
        worth = -20 * abs(far) - 3 * abs(fingers - puck + 0.045 * np.exp(1j * np.angle(far)))
        gain = np.nan_to_num(worth - self.worth[copies]) - 0.01
        self.worth[copies] = worth
        jumps = (self.steps[copies] == self.jumps_at[copies]) & (self.displaced > 0)
        if jumps.any():
            self.place(copies[jumps], (puck + self.displaced * self.jump[copies])[jumps])
        done = (abs(far) < 0.8 * NEAR) & (abs(speed) < 0.02)
        return Outcome(gain + 2 * done, done, info={"is_success": abs(far) < NEAR})
