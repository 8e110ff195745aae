"""The observation `full`: what it holds."""

from contextlib import closing
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from opened_environment import opened

from o80_table_tennis.settings import TaskSettings
from o80_table_tennis.task.actions import COARSE
from o80_table_tennis.task.full_observation import FullObservation
from o80_table_tennis.task.noise import NoiseSettings

FULL = FullObservation()
PLACES = FULL.places()


def part(observation: Any, name: str) -> Any:
    """A part in its own unit."""
    numbers = np.asarray(observation, np.float64) * FULL.scales + FULL.centres
    return numbers[..., PLACES[name]]


def full_task(**more: Any) -> TaskSettings:
    return TaskSettings(balls="wide", observation="full", factor=COARSE, **more)


def random_actions(count: int) -> NDArray[np.float32]:
    return np.random.default_rng(4).uniform(-1, 1, (count, 8)).astype(np.float32)


def test_it_holds_the_arm_the_pressures_and_what_was_asked() -> None:
    actions = random_actions(12)
    with closing(opened(task=full_task())) as environment:
        observation, _ = environment.reset(seed=2)
        assert observation.shape == (73,)
        assert not part(observation, "changes").any()
        commanded = [part(observation, "asked")]
        for action in actions:
            observation, *_ = environment.step(action)
            commanded.append(part(observation, "asked"))
        row = environment.arm.latest()
        task = environment.task
    positions = row.extended.joint_positions
    np.testing.assert_allclose(part(observation, "joint_positions"), positions, atol=1e-6)
    normalised = task.range.normalised(np.array(row.observed))
    np.testing.assert_allclose(part(observation, "pressures"), normalised, atol=1e-6)
    np.testing.assert_allclose(part(observation, "racket"), task.state.racket[0], atol=1e-6)
    assert part(observation, "time") == pytest.approx(0.12)
    # the newest change first; tanh is nearly straight, but for pressures at their limits
    changes = part(observation, "changes").reshape(4, 8)
    inside = np.diff(commanded, axis=0)[::-1][:4]
    np.testing.assert_allclose(changes, inside / (0.5 * np.tanh(0.5)), atol=1e-5)
    free = np.all([(each > 0.01) & (each < 0.99) for each in commanded[-5:]], axis=0)
    assert free.any()
    np.testing.assert_allclose(changes[:, free], actions[::-1][:4][:, free], atol=0.05)


def test_the_ball_and_its_crossing_are_those_of_the_flight() -> None:
    crossings, rows = [], []
    with closing(opened(task=full_task())) as environment:
        observation, _ = environment.reset(seed=7)
        for _ in range(60):
            observation, *_ = environment.step(np.zeros(8, np.float32))
            true = environment.task.state.ball[0]
            np.testing.assert_allclose(part(observation, "ball_position"), true[:3], atol=0.002)
            np.testing.assert_allclose(part(observation, "ball_velocity"), true[3:], atol=0.05)
            time = float(part(observation, "time")[0] + part(observation, "crossing_time")[0])
            crossings.append([*part(observation, "crossing_position"), time])
            rows.append([*true])
        while true[1] > FULL.plane:
            environment.step(np.zeros(8, np.float32))
            before, true = rows[-1], environment.task.state.ball[0]
            rows.append([*true])
    share = (before[1] - FULL.plane) / (before[1] - true[1])
    there = np.array(before[:3]) + share * (true[:3] - before[:3])
    time = 0.01 * (len(rows) - 1 + share)
    off = np.array(crossings)[10:] - [there[0], there[2], time]
    assert (np.abs(off).max(axis=0) < [0.01, 0.02, 0.01]).all()


def test_everything_is_scaled_to_about_one() -> None:
    rows = []
    with closing(opened(task=full_task(noise=NoiseSettings.tracker()))) as environment:
        space = environment.observation_space
        for seed in range(5):
            observation, _ = environment.reset(seed=seed)
            over, actions = False, iter(random_actions(300) * 0.3)
            while not over:
                rows.append(observation)
                assert space.contains(observation)
                observation, _, terminated, truncated, _ = environment.step(next(actions))
                over = terminated or truncated
    spread = np.abs(rows)
    assert np.percentile(spread, 99, axis=0).max() < 3.0
    assert np.mean(spread) < 1.0
