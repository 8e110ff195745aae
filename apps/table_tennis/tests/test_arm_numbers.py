"""The numbers of an arm, as it describes itself."""

from typing import Any

import numpy as np
import pytest

import o80
from o80_table_tennis.players.hitting_policy import HittingSettings
from o80_table_tennis.rig.pressure_range import PressureRange
from o80_table_tennis.settings import RigSettings


def test_the_standard_arm_is_the_one_that_players_assume() -> None:
    assumed = HittingSettings()
    told = HittingSettings.of_rig(RigSettings())
    q = np.array([0.3, 1.1, 1.4, -0.5])
    for torque in np.random.default_rng(1).uniform(-20.0, 20.0, (20, 4)):
        pressures = told.muscles.pressures(torque, q, 0.45)
        assert pressures == pytest.approx(assumed.muscles.pressures(torque, q, 0.45))
    assert (told.lag, told.dead_time) == (assumed.lag, assumed.dead_time)
    assert told.arm.damping == assumed.arm.damping


def test_options_and_presets_are_told_as_they_act() -> None:
    numbers = HittingSettings.of_rig(RigSettings(preset="identified"))
    assert numbers.dead_time == (0.04, 0.04, 0.02, 0.01)
    assert numbers.muscles.directions == (-1.0, 1.0, -1.0, 1.0)
    # 15000 to 25000 raw are 1.21 to 3.21 bar, of 3.6 at full activation
    assert numbers.muscles.least[0][0] == pytest.approx(1.2112 / 3.6)
    assert numbers.muscles.most[0][0] == pytest.approx(3.2112 / 3.6)
    options: dict[str, Any] = {
        "dead_time": [0.002, 0.004, 0.006, 0.008],
        "damping": [3.0, -1, -1, -1],
    }
    with o80.robots.load("pam").inline(preset="identified", **options) as arm:
        other = HittingSettings.of(arm)
    assert other.dead_time == (0.002, 0.004, 0.006, 0.008)
    assert other.arm.damping == (3.0, *numbers.arm.damping[1:])


@pytest.mark.parametrize("preset", ["standard", "identified"])
def test_activations_are_those_of_the_arm(preset: str) -> None:
    with o80.robots.load("pam").inline(preset=preset) as arm:
        numbers, row = HittingSettings.of(arm), arm.latest()
        least, most = np.ravel(numbers.muscles.least), np.ravel(numbers.muscles.most)
        share = PressureRange.of(arm).normalised(np.array(row.observed))
        seen = np.array(row.extended.activations)
    assert least + share * (most - least) == pytest.approx(seen)


def test_a_robot_that_tells_nothing_is_refused() -> None:
    with (
        o80.robots.load("two_joints").inline() as robot,
        pytest.raises(ValueError, match="does not describe its muscles: attach to a robot `pam`"),
    ):
        HittingSettings.of(robot)
