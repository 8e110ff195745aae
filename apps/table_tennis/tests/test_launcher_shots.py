"""Shots of the ball launcher, by the launch model of o80-devices."""

import numpy as np

from o80_table_tennis.balls.playable import Verdict, verdict
from o80_table_tennis.balls.simulated_shots import DISTRIBUTIONS, SimulatedShots


def test_shots_of_the_launcher_are_one_of_the_distributions_and_can_be_played() -> None:
    shots = SimulatedShots(DISTRIBUTIONS["launcher"], seed=1)
    launches = [shots.launch(number) for number in range(50)]
    assert all(verdict(launch) is Verdict.PLAYABLE for launch in launches)
    assert launches[3].velocity.tolist() == shots.launch(3).velocity.tolist()
    assert np.std([launch.spin[0] for launch in launches]) > 10.0
