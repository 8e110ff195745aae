"""The flight that decides whether a shot can be played, beside the law of the air it writes out."""

import math

import numpy as np
import pytest

from o80_table_tennis.balls.playable import STEP, _later
from o80_table_tennis.physics.aerodynamics import AERODYNAMICS, runge_kutta_step


@pytest.mark.parametrize("spinning", [True, False])
def test_a_step_of_the_flight_is_that_of_the_law_of_the_air_bit_for_bit(spinning: bool) -> None:
    random = np.random.default_rng(3)
    halfway = math.exp(-AERODYNAMICS.spin_decay * STEP / 2)
    for _ in range(1000):
        x, y, z, vx, vy, vz = random.uniform(-6.0, 6.0, 6).tolist()
        wx, wy, wz = (random.uniform(-100.0, 100.0, 3) if spinning else np.zeros(3)).tolist()
        state = (x, y, z, vx, vy, vz)
        share = AERODYNAMICS.magnus * halfway
        rate = math.sqrt(wx * wx + wy * wy + wz * wz)
        flown = runge_kutta_step(
            state,
            (share * wx, share * wy, share * wz),
            AERODYNAMICS.drag,
            AERODYNAMICS.gravity,
            STEP,
            AERODYNAMICS.halved_at(halfway * rate),
        )
        kept = halfway * halfway
        assert _later(state, (wx, wy, wz)) == (flown, (kept * wx, kept * wy, kept * wz))
