"""The model of the table-tennis scene is the arm of the plant: MuJoCo's numbers are its reference.

The C++ tests of the arm compare the plant with `robots/pam/tests/cpp/mujoco_reference.txt`; here
the same numbers are computed anew from the model. After a change of the model write the file with
`python apps/table_tennis/tests/test_pam_model.py`.
"""

from pathlib import Path

import mujoco
import numpy as np
import numpy.typing as npt
import pytest

ROOT = Path(__file__).resolve().parents[3]
MODEL = ROOT / "apps/table_tennis/o80_table_tennis/world/table_tennis.xml"
REFERENCE = ROOT / "robots/pam/tests/cpp/mujoco_reference.txt"
HEADER = "racket and dynamics of the arm by MuJoCo: q dq torque | position rotation velocity omega"
JOINTS = 4

Numbers = npt.NDArray[np.float64]


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(MODEL))


def reference_row(model: mujoco.MjModel, q: Numbers, dq: Numbers, torque: Numbers) -> Numbers:
    """Numbers of the engine for one motion of the arm: inputs, then all outputs."""
    data = mujoco.MjData(model)
    arm = slice(0, JOINTS)
    data.qpos[arm], data.qvel[arm], data.qfrc_applied[arm] = q, dq, torque
    mujoco.mj_forward(model, data)

    mass = np.zeros((model.nv, model.nv))
    for column in range(model.nv):
        unit = np.zeros(model.nv)
        unit[column] = 1.0
        mujoco.mj_mulM(model, data, mass[column], unit)
    racket = model.body("racket").id
    velocity = np.zeros(6)  # angular, then linear, in the world's axes
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, racket, velocity, 0)
    return np.concatenate(
        [
            *(q, dq, torque),
            *(data.xpos[racket], data.xmat[racket], velocity[3:], velocity[:3]),
            *(mass[arm, arm].ravel(), data.qfrc_bias[arm], data.qacc[arm]),
        ]
    )


def reference(model: mujoco.MjModel) -> Numbers:
    """Forty-eight motions all over the arm's range, the stops left out, and the playing posture."""
    random = np.random.default_rng(20)
    rows = [
        reference_row(model, np.array([0.17, 1.1, 1.04, 0.5]), np.zeros(JOINTS), np.zeros(JOINTS))
    ]
    for _ in range(48):
        q = random.uniform(-1.5, 1.5, JOINTS)
        dq = random.uniform(-6.0, 6.0, JOINTS)
        rows.append(reference_row(model, q, dq, random.uniform(-30.0, 30.0, JOINTS)))
    return np.array(rows)


def test_the_committed_reference_is_what_mujoco_computes(model: mujoco.MjModel) -> None:
    np.testing.assert_allclose(np.loadtxt(REFERENCE), reference(model), rtol=1e-9, atol=1e-9)


def test_the_scene_has_the_names_and_figures_of_the_experiment(model: mujoco.MjModel) -> None:
    assert model.opt.timestep == 0.002
    assert [model.joint(f"joint_{j}").qposadr[0] for j in range(1, JOINTS + 1)] == [0, 1, 2, 3]
    assert model.joint("ball").type[0] == mujoco.mjtJoint.mjJNT_FREE
    assert model.body("ball").mass[0] == 0.0027
    assert model.geom("ball").size[0] == 0.02

    table, net = model.geom("table"), model.geom("net")
    np.testing.assert_allclose(table.size * 2, [1.525, 2.74, 0.04])
    np.testing.assert_allclose(table.pos, [0.4, 1.57, 0.755])
    assert net.pos[2] + net.size[2] == pytest.approx(0.775 + 0.1525)
    assert net.size[1] * 2 == pytest.approx(0.02)
    blade = model.geom("racket").size * 2
    np.testing.assert_allclose(blade, [0.1485, 0.0054, 0.1882])
    assert {model.cam(c).name for c in range(model.ncam)} >= {"side", "behind"}


def test_the_engine_sees_no_contact_even_with_the_ball_in_the_table(model: mujoco.MjModel) -> None:
    data = mujoco.MjData(model)
    data.qpos[JOINTS : JOINTS + 3] = [0.4, 1.0, 0.77]
    mujoco.mj_forward(model, data)
    assert data.ncon == 0


def test_the_ball_falls_freely_in_the_engine(model: mujoco.MjModel) -> None:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.qacc[JOINTS:], [0, 0, -9.81, 0, 0, 0], atol=1e-9)


def test_extra_balls_can_be_added_to_the_scene() -> None:
    spec = mujoco.MjSpec.from_file(str(MODEL))
    for number in range(20):
        ball = spec.worldbody.add_body(name=f"extra_{number}")
        ball.add_freejoint()
        ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.02, 0, 0], mass=0.0027)
    assert spec.compile().nq == JOINTS + 7 * 21


if __name__ == "__main__":
    scene = mujoco.MjModel.from_xml_path(str(MODEL))
    np.savetxt(REFERENCE, reference(scene), fmt="%.17g", header=HEADER)
