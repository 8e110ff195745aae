"""The numbers of drag and Magnus force."""

import math

import pytest

from o80_table_tennis.physics.aerodynamics import Aerodynamics


def test_the_drag_is_the_published_formula() -> None:
    air = Aerodynamics(drag_coefficient=0.47, lift_coefficient=1.47)

    area = math.pi * 0.02**2
    assert air.drag == pytest.approx(0.5 * 1.18 * 0.47 * area / 0.0027)
    assert air.magnus == pytest.approx(0.5 * 1.18 * 1.47 * area * 0.02 / 0.0027)
