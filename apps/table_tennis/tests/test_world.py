"""The numbers that the application reads from the scene are those of simulator and robot."""

import mujoco
import numpy as np
import numpy.typing as npt
import pytest

from o80_table_tennis.world import arm
from o80_table_tennis.world.arm import racket_pose
from o80_table_tennis.world.ball import BALL_MASS, BALL_RADIUS, GRAVITY
from o80_table_tennis.world.scene import MODEL
from o80_table_tennis.world.table import NET_HEIGHT, TABLE
from o80_table_tennis.world.timing import PERIOD

ARM = slice(0, 4)

Numbers = npt.NDArray[np.float64]


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(MODEL))


def postures(count: int) -> list[Numbers]:
    return list(np.random.default_rng(3).uniform(-1.4, 1.4, (count, 4)))


def test_what_is_read_from_the_file_is_what_the_simulator_simulates(model: mujoco.MjModel) -> None:
    """Angles, lengths and masses as MuJoCo compiles them, with no unit or default of its own."""
    assert [model.joint(name).id for name in arm.JOINT_NAMES] == list(range(arm.JOINTS))
    assert np.abs(model.jnt_range[ARM]) == pytest.approx(arm.JOINT_LIMIT)
    assert model.dof_damping[ARM] == pytest.approx(arm.JOINT_DAMPING)
    assert model.opt.timestep == PERIOD
    assert model.opt.gravity[2] == -GRAVITY
    assert model.geom("ball").size[0] == BALL_RADIUS
    assert model.body("ball").mass[0] == BALL_MASS
    assert tuple(2 * model.geom("table").size) == TABLE.size
    assert tuple(model.geom("table").pos) == TABLE.centre
    assert model.geom("net").pos[2] + model.geom("net").size[2] - TABLE.top == (
        pytest.approx(NET_HEIGHT)
    )
    assert 2 * model.geom("racket").size[1] == arm.BLADE_THICKNESS
    for name in ("upper_arm", "elbow", "forearm", "racket"):
        mass = arm.mass_of(name)
        assert (mass.mass, mass.centre) == (model.body(name).mass[0], model.body(name).ipos[2])


def test_the_racket_is_where_the_scene_has_it(model: mujoco.MjModel) -> None:
    data, racket = mujoco.MjData(model), model.body("racket").id
    for q in postures(40):
        data.qpos[ARM] = q
        mujoco.mj_kinematics(model, data)
        pose = racket_pose(q)
        assert pose.position == pytest.approx(data.xpos[racket], abs=1e-9)
        assert pose.normal == pytest.approx(data.xmat[racket].reshape(3, 3)[:, 1], abs=1e-9)
