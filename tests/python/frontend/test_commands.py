"""Commands: targets, paces, profiles, queues."""

import pytest
from processes import WAIT

import o80


# rule C5
@pytest.mark.parametrize(
    ("pace", "iterations"),
    [
        ({}, 1),
        ({"iterations": 4}, 4),
        ({"duration": 0.005}, 5),
        ({"speed": 100.0}, 5),
        ({"until": 6}, 6),
    ],
)
def test_each_pace_takes_its_iterations(
    arm: o80.Frontend, pace: dict[str, float], iterations: int
) -> None:
    arm.add_command(0, 0.5, **pace)  # type: ignore[arg-type]

    observation = arm.pulse_and_wait(timeout=WAIT)

    assert observation.iteration == iterations
    assert observation.desired[0] == 0.5


# rule C4
def test_a_command_may_start_from_the_observed_state(arm: o80.Frontend) -> None:
    arm.add_command(0, 1.0)
    observed = arm.burst(1).observed[0]
    arm.add_command(0, 1.0, iterations=2, start=o80.Start.OBSERVED)

    assert arm.burst(1).desired[0] == pytest.approx((observed + 1.0) / 2)
