"""Accelerated episodes are the same twice, bit for bit: inline, as processes, after a restore."""

from contextlib import closing
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from o80.learning import EVERY
from o80_table_tennis.environment import TableTennisEnvironment
from o80_table_tennis.settings import Pacing, RigSettings, TaskSettings
from o80_table_tennis.task.actions import COARSE
from o80_table_tennis.world.arm import MUSCLES
from o80_table_tennis.world.timing import ITERATIONS

EPISODES = 3
STEPS = 100
SEED = 11

Rows = list[bytes]


def rig_settings(pacing: Pacing) -> RigSettings:
    return RigSettings(pacing=pacing, worlds=4, start_noise=0.02)


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
        frontends = [environment.arm, *environment.twins]
        rows = [each.history().rows.tobytes() for each in frontends]
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
    actions = np.random.default_rng(6).uniform(-1, 1, (STEPS, MUSCLES)).astype(np.float32)
    rig = RigSettings(pacing=pacing, start_noise=0.02)
    with closing(TableTennisEnvironment(rig=rig, task=TaskSettings(factor=0.2))) as environment:
        frontends = [environment.arm, *environment.twins]
        environment.reset(seed=1, options={"ball": 0})
        run(environment, actions[:20])
        asked = environment.task.state.asked.copy()
        for frontend in frontends:
            frontend.request("snapshot", slot=2)
        environment.task.robot.rows[...] = environment.arm.history(1).rows
        environment.task.single.begin()
        first = run(environment, actions[20:])
        for frontend in frontends:
            frontend.request("restore", slot=2)
        environment.task.robot.rows[...] = environment.arm.history(1).rows
        environment.task.single.begin()
        environment.task.state.asked[...] = asked
        second = run(environment, actions[20:])

    for before, after in zip(first, second, strict=True):
        np.testing.assert_array_equal(before, after)


def run(environment: TableTennisEnvironment, actions: NDArray[np.float32]) -> list[NDArray[Any]]:
    """Observed and extended bytes of all rows of arm and twins; iterations go on, they do not."""
    for action in actions:
        environment.task.step(action[np.newaxis], EVERY)
    rows = len(actions) * ITERATIONS
    seen: list[NDArray[Any]] = [environment.arm.history(rows).flat(np.float64)]
    for twin in environment.twins:
        history = twin.history(rows)
        seen += [history.observed.joints["position"], history.observed.balls["position"]]
        seen += [
            history.observed.balls["velocity"],
            history.extended.contacts["racket"]["smallest_distance"],
        ]
    return seen
