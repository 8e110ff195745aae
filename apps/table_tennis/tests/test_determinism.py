"""Accelerated episodes are the same twice, bit for bit: inline, as processes, after a restore."""

from contextlib import closing
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from o80.learning import EVERY
from o80_table_tennis.balls.sources import balls_from
from o80_table_tennis.environment import TableTennisEnvironment
from o80_table_tennis.rig.rig import Rig
from o80_table_tennis.settings import Pacing, RigSettings, TaskSettings
from o80_table_tennis.task.actions import COARSE
from o80_table_tennis.world.arm import MUSCLES
from o80_table_tennis.world.timing import ITERATIONS

EPISODES = 3
STEPS = 100
SEED = 11

Rows = list[bytes]


def rig_settings(pacing: Pacing) -> RigSettings:
    return RigSettings(pacing=pacing, twins=2, extra_balls=3, start_noise=0.02)


def histories(pacing: Pacing, *, seed: int = SEED) -> tuple[Rows, list[Any]]:
    """All rows of arm and twins, byte for byte, and all that the environment returned."""
    rng = np.random.default_rng(5)
    returned: list[Any] = []
    environment = TableTennisEnvironment(rig=rig_settings(pacing), task=TaskSettings(factor=COARSE))
    with closing(environment):
        for episode in range(EPISODES):
            observation, info = environment.reset(seed=seed if episode == 0 else None)
            returned.append((observation.tobytes(), repr(info)))
            over = False
            while not over:
                action = rng.uniform(-1, 1, MUSCLES).astype(np.float32)
                observation, reward, terminated, truncated, info = environment.step(action)
                returned.append((observation.tobytes(), reward, terminated, truncated, repr(info)))
                over = terminated or truncated
        rig = environment.rig
        rows = [rig.arm.frontend.history().rows.tobytes()]
        rows += [twin.frontend.history().rows.tobytes() for twin in rig.twins]
    return rows, returned


@pytest.fixture(scope="module")
def reference() -> tuple[Rows, list[Any]]:
    return histories(Pacing.INLINE)


@pytest.mark.parametrize("pacing", [Pacing.INLINE, Pacing.PROCESSES])
def test_the_same_seed_gives_the_same_histories_bit_for_bit(
    reference: tuple[Rows, list[Any]], pacing: Pacing
) -> None:
    rows, returned = histories(pacing)

    assert returned == reference[1]
    assert rows == reference[0]


def test_another_seed_gives_other_histories(reference: tuple[Rows, list[Any]]) -> None:
    rows, _ = histories(Pacing.INLINE, seed=SEED + 1)

    assert all(mine != its for mine, its in zip(rows, reference[0], strict=True))


@pytest.mark.parametrize("pacing", [Pacing.INLINE, Pacing.PROCESSES])
def test_a_restored_rig_runs_again_bit_for_bit(pacing: Pacing) -> None:
    actions = np.random.default_rng(6).uniform(0.1, 0.9, (STEPS, MUSCLES))
    with Rig(rig_settings(pacing)) as rig:
        frontends = [rig.arm.frontend, *(twin.frontend for twin in rig.twins)]
        begin(rig)
        run(rig, actions[:20])
        for frontend in frontends:
            frontend.request("snapshot", slot=2)
        first = run(rig, actions[20:])
        for frontend in frontends:
            frontend.request("restore", slot=2)
        rig.row = rig.arm.newest
        second = run(rig, actions[20:])

    for before, after in zip(first, second, strict=True):
        np.testing.assert_array_equal(before, after)


def begin(rig: Rig) -> None:
    """Arm at rest, the balls in free flight: what is imposed is no part of a snapshot."""
    flight = balls_from(None).flight(0)
    flights = [[flight] * (1 + rig.settings.extra_balls)]
    rig.reset(EVERY, arm_seeds=[1], twin_seeds=[1], flights=flights)


def run(rig: Rig, actions: NDArray[np.float64]) -> list[NDArray[Any]]:
    """Observed and extended bytes of all rows of arm and twins; iterations go on, they do not."""
    for action in actions:
        rig.step(action[np.newaxis])
    rows = len(actions) * ITERATIONS
    seen: list[NDArray[Any]] = [rig.arm.frontend.history(rows).flat(np.float64)]
    for twin in rig.twins:
        history = twin.frontend.history(rows)
        seen += [history.observed.joints["position"], history.observed.balls["position"]]
        seen += [
            history.observed.balls["velocity"],
            history.extended.contacts["racket"]["smallest_distance"],
        ]
    return seen
