"""Accelerated episodes are the same twice, bit for bit: inline, as processes, after a restore."""

from contextlib import closing
from typing import Any

import numpy as np
import pytest

from o80_table_tennis.environment import TableTennisEnvironment
from o80_table_tennis.settings import Pacing, RigSettings, TaskSettings
from o80_table_tennis.task.actions import COARSE
from o80_table_tennis.world.arm import MUSCLES

EPISODES = 3
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
