"""The numbers of drag and Magnus force."""

import math

import numpy as np
import pytest

from o80_mujoco.balls import accelerations
from o80_table_tennis.physics.aerodynamics import Aerodynamics


def test_the_drag_is_the_published_formula() -> None:
    air = Aerodynamics(drag_coefficient=0.47, lift_coefficient=1.47)

    area = math.pi * 0.02**2
    assert air.drag == pytest.approx(0.5 * 1.18 * 0.47 * area / 0.0027)
    assert air.magnus == pytest.approx(0.5 * 1.18 * 1.47 * area * 0.02 / 0.0027)


def test_all_numbers_reach_the_law() -> None:
    air = Aerodynamics(gravity=9.0)
    velocity, spin = np.array([0.5, -4.0, 1.0]), np.array([80.0, -40.0, 30.0])
    speed, turning = np.linalg.norm(velocity), air.halved_at(float(np.linalg.norm(spin)))

    found = accelerations(np.concatenate([np.zeros(3), velocity, spin])[None], air.air)[0]

    lift = air.magnus * speed / (speed + turning) * np.cross(spin, velocity)
    expected = lift - air.drag * speed * velocity - [0.0, 0.0, 9.0]
    np.testing.assert_allclose(found, expected, rtol=1e-12)
