"""Torques to pressures to actions."""

import numpy as np
import pytest

from o80_table_tennis.players.pressure_control import MusclePair, PressureActions, PressureLag
from o80_table_tennis.task.actions import COARSE, FINE, changed_pressures


def test_pressures_make_their_torques() -> None:
    muscles = MusclePair()
    q = np.array([0.3, 1.1, 1.4, -0.5])
    for torque in np.random.default_rng(1).uniform(-8.0, 8.0, (20, 4)):
        pressures = muscles.pressures(torque, q, 0.45)
        contraction = muscles.contracted + np.outer(q, [1.0, -1.0]) * muscles.pulley
        force = np.asarray(muscles.maximum_force) * pressures * (1.0 - contraction / muscles.stroke)
        assert muscles.pulley * (force[:, 0] - force[:, 1]) == pytest.approx(torque)


def test_a_slack_muscle_leaves_the_torque_to_the_other() -> None:
    pressures = MusclePair().pressures(np.array([20.0, -20.0, 0.0, 0.0]), np.zeros(4), 0.1)
    made = 0.037 * 1500.0 * 0.8 * (pressures[:, 0] - pressures[:, 1])
    assert made == pytest.approx([20.0, -20.0, 0.0, 0.0])


def test_asking_undoes_the_lag() -> None:
    lag, now, wanted = PressureLag(), np.full(8, 0.4), np.linspace(0.3, 0.5, 8)
    commanded = lag.asking(now, wanted, 0.014)
    assert lag.after(now, commanded, 0.014) == pytest.approx(wanted)


@pytest.mark.parametrize("factor", [COARSE, FINE])
def test_actions_lead_to_the_wanted_pressures(factor: float) -> None:
    actions = PressureActions(factor=factor)
    start = np.full(8, 0.5)
    actions.start(start)
    wanted = np.linspace(-0.2, 1.2, 8)
    pressures = start
    for _ in range(100):
        action = actions.towards(wanted)
        assert np.all(np.abs(action) <= 1.0)
        taken = action.astype(np.float64)
        pressures = changed_pressures(pressures, taken, factor=factor)
        assert actions.commanded == pytest.approx(pressures)
    assert pressures == pytest.approx(np.clip(wanted, 0.0, 1.0), abs=1e-6)
