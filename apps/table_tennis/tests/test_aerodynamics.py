"""Drag and Magnus force in one step of the motion."""

import math

import numpy as np
import pytest

from o80_table_tennis.physics.aerodynamics import Aerodynamics, runge_kutta_step


def test_the_drag_is_the_published_formula() -> None:
    air = Aerodynamics(drag_coefficient=0.47, lift_coefficient=1.47)

    area = math.pi * 0.02**2
    assert air.drag == pytest.approx(0.5 * 1.18 * 0.47 * area / 0.0027)
    assert air.magnus == pytest.approx(0.5 * 1.18 * 1.47 * area * 0.02 / 0.0027)


def test_many_balls_in_one_step_fly_like_each_alone() -> None:
    turns, drags = np.linspace(-0.4, 0.4, 5), np.linspace(0.0, 0.2, 5)
    start = (0.0, 0.0, 1.0, 0.5, -4.0, 2.0)

    many = runge_kutta_step(
        tuple(np.full(5, value) for value in start),  # type: ignore[arg-type]
        (turns, 0 * turns, 0 * turns),
        drags,
        9.81,
        0.01,
    )

    for ball in range(5):
        alone = runge_kutta_step(start, (turns[ball], 0.0, 0.0), drags[ball], 9.81, 0.01)
        np.testing.assert_allclose([value[ball] for value in many], alone, rtol=1e-14)
