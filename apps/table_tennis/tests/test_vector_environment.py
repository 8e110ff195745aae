"""Many copies of the accelerated environment in one call (o80_table_tennis.copies)."""

from __future__ import annotations

from functools import partial
from itertools import cycle
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from recorded_rows import simulated_shot
from vector_equality import MODES, beside, both

import o80_table_tennis
from o80 import GroupBurst
from o80.learning import VectorEnvironment
from o80_table_tennis.balls.sources import balls_from
from o80_table_tennis.settings import Pacing, RigSettings, TaskSettings
from o80_table_tennis.task.actions import COARSE
from o80_table_tennis.task.end import EndRule
from o80_table_tennis.task.noise import NoiseSettings
from o80_table_tennis.task.observations import BALL_POSITION
from o80_table_tennis.world.arm import MUSCLES

COPIES = 4
SHORT = EndRule(max_steps=40)
RIGS = {
    "standard": RigSettings(start_noise=0.02),
    "identified": RigSettings(preset="identified"),
    "another frequency": RigSettings(frequency=250.0),
    "worlds": RigSettings(worlds=3),
}
NOISY = NoiseSettings(0.005, 0.1, 0.1, latency=0.013, pressure=0.01, start_posture=0.02)
TASKS = {
    "return": TaskSettings(factor=COARSE),
    "wide": TaskSettings(factor=0.3, balls="wide", ball_seed=4, reward="published"),
    "repeat": TaskSettings(factor=COARSE, repeat=3),
    "fly out": TaskSettings(factor=0.05, fly_out=True, repeat=2),
    "noise": TaskSettings(factor=COARSE, noise=NOISY),
    "full": TaskSettings(factor=COARSE, balls="wide", observation="full", noise=NOISY),
    "full, repeat": TaskSettings(factor=COARSE, observation="full", repeat=2),
    "short": TaskSettings(factor=COARSE, end=SHORT, delay=0),
    "smash": TaskSettings(task="smash", delay=3, factor=COARSE),
}


def made(
    copies: int = COPIES, mode: Any = AutoresetMode.NEXT_STEP, **settings: Any
) -> VectorEnvironment:
    environment = gymnasium.make_vec(
        o80_table_tennis.ACCELERATED, num_envs=copies, autoreset_mode=mode, **settings
    )
    assert isinstance(environment, VectorEnvironment)
    return environment


def assert_equals_single_ones(mode: Any, policy: Any, *, steps: int, **settings: Any) -> int:
    single = partial(gymnasium.make, o80_table_tennis.ACCELERATED, **settings)
    with made(mode=mode, threads=2, **settings) as vector:
        vector.action_space.seed(7)
        chosen = policy or (lambda seen, number: vector.action_space.sample())
        return beside(vector, single, chosen, steps=steps, seed=5)


@pytest.mark.parametrize(("mode", "task"), [*zip(cycle(MODES), TASKS)])
def test_equals_single_environments_under_random_actions(mode: AutoresetMode, task: str) -> None:
    settings = TASKS[task]
    ends = assert_equals_single_ones(
        mode, None, steps=190, task=settings, rig=RigSettings(start_noise=0.02)
    )
    assert ends >= COPIES


@pytest.mark.parametrize("rig", RIGS)
def test_equals_single_environments_of_every_rig(rig: str) -> None:
    task = TaskSettings(factor=COARSE, end=SHORT)
    mode = AutoresetMode.SAME_STEP
    ends = assert_equals_single_ones(mode, None, steps=90, task=task, rig=RIGS[rig])
    assert ends >= 2 * COPIES


def test_resets_some_copies_with_a_ball_of_the_callers() -> None:
    mode = AutoresetMode.DISABLED
    make = partial(gymnasium.make, o80_table_tennis.ACCELERATED)
    singles: Any = gymnasium.vector.SyncVectorEnv([make] * COPIES, autoreset_mode=mode)
    flight = balls_from(None).flight(3)
    actions = np.full((COPIES, MUSCLES), 0.5, np.float32)
    with made(mode=mode) as vector:
        both(vector, singles, lambda each: each.reset(seed=[3, 1, 4, 1], options={"ball": 2}))
        both(vector, singles, lambda each: each.step(actions))
        mask = np.array([True, False, False, True])
        options = {"reset_mask": mask, "flight": flight}
        both(vector, singles, lambda each: each.reset(seed=9, options=dict(options)))
        for _ in range(30):
            both(vector, singles, lambda each: each.step(actions))
        both(vector, singles, lambda each: each.reset())
    singles.close()


def test_a_step_has_no_timeout(monkeypatch: pytest.MonkeyPatch) -> None:
    """A training that somebody stops (Ctrl-Z, a debugger) must go on when it is continued."""
    run, timeouts = GroupBurst.run, []

    def noted(*arguments: Any, timeout: float | None = None) -> None:
        timeouts.append(timeout)
        run(*arguments, timeout=timeout)

    monkeypatch.setattr(GroupBurst, "run", noted)
    with made(2) as vector:
        vector.reset(seed=1)
        vector.step(np.zeros((2, MUSCLES), np.float32))
    assert set(timeouts) == {None}


def test_plays_long_recorded_flights() -> None:
    with made(2, mode=AutoresetMode.DISABLED) as vector:
        shot = simulated_shot(np.random.default_rng(1)).resample(0.002)
        assert len(shot.positions) > 500
        vector.reset(seed=1, options={"flight": shot})
        for _ in range(60):
            seen, *_ = vector.step(np.zeros((2, MUSCLES), np.float32))
        np.testing.assert_allclose(seen[0, BALL_POSITION], shot.positions[300], atol=1e-6)


def test_a_rig_that_copies_cannot_have_is_refused() -> None:
    with pytest.raises(ValueError, match=r"needs pacing=Pacing\.INLINE.*make it of single env"):
        made(2, rig=RigSettings(pacing=Pacing.PROCESSES))
