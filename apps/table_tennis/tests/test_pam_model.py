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


if __name__ == "__main__":
    scene = mujoco.MjModel.from_xml_path(str(MODEL))
    np.savetxt(REFERENCE, reference(scene), fmt="%.17g", header=HEADER)
