"""The torques of the player's model of the arm, beside those of the scene."""

import mujoco
import numpy as np
import pytest

from o80_table_tennis.players.arm_dynamics import ArmModel
from o80_table_tennis.world.scene import MODEL

PLAYING = np.array([0.17, 1.1, 1.04, 0.5])
ARM = slice(0, 4)


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(MODEL))


def test_torques_are_nearly_those_of_the_scene(model: mujoco.MjModel) -> None:
    """Motions of play: joint 1 fast, the others slow, without the effects that the model omits."""
    data = mujoco.MjData(model)
    rng = np.random.default_rng(5)
    for _ in range(30):
        q = PLAYING + rng.uniform(-0.4, 0.4, 4)
        dq = rng.uniform(-1.0, 1.0, 4) * [3.0, 0.3, 0.3, 0.3]
        ddq = rng.uniform(-1.0, 1.0, 4) * [15.0, 5.0, 5.0, 5.0]
        data.qpos[ARM], data.qvel[ARM], data.qacc[:] = q, dq, 0.0
        data.qacc[ARM] = ddq
        mujoco.mj_inverse(model, data)
        wanted = data.qfrc_inverse[ARM]
        torque = ArmModel().torque(q, dq, ddq)
        assert torque == pytest.approx(wanted, abs=0.15 + 0.03 * np.abs(wanted).max())
