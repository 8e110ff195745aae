"""Noise of what is observed: as large as asked for, drawn from the episode's generator."""

from contextlib import closing
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from opened_environment import PUSH, STILL, opened

from o80.base.arrays import FloatArray
from o80_table_tennis.balls.simulated_shots import SimulatedShots
from o80_table_tennis.physics.prediction import predict
from o80_table_tennis.settings import TaskSettings
from o80_table_tennis.task.ball_record import BallRecord
from o80_table_tennis.task.noise import NoiseSettings
from o80_table_tennis.task.perception import BLOCK, NoisyPerception
from o80_table_tennis.task.state import State

STEPS = 2 * BLOCK + 10


def state_of(balls: FloatArray, pressures: FloatArray) -> State:
    nothing = np.zeros((*balls.shape[:-1], 8))
    racket = nothing[..., :3]
    return State(
        *(np.zeros(len(balls), np.int64), nothing, pressures, pressures),
        *(racket, balls, BallRecord(1.0), racket),
    )


def perceived(
    noise: NoiseSettings, balls: FloatArray, *, seed: int = 0
) -> tuple[FloatArray, NDArray[Any], FloatArray]:
    """Observed balls (T, 6), missed (T,) and pressures (T, 8) of one episode."""
    perception = NoisyPerception(noise, 0.01, 1)
    half = np.full((1, 8), 0.5)
    generator, only = np.random.default_rng(seed), np.zeros(1, np.int64)
    seen = [perception.begin(state_of(balls[:1], half), [generator], only)]
    seen += [perception.perceive(state_of(ball[None], half)) for ball in balls[1:]]
    rows = [(each.ball, each.missed, each.pressures) for each in seen]
    observed, missed, pressures = (np.concatenate(column) for column in zip(*rows, strict=True))
    return observed, missed, pressures


STANDING = np.tile([0.4, 2.0, 1.0, 0.1, -4.0, 0.5], (STEPS, 1))


def test_the_noise_is_as_large_as_asked_for_and_white() -> None:
    noise = NoiseSettings(ball_position=0.01, ball_velocity=0.2, pressure=0.03)
    balls, missed, pressures = perceived(noise, STANDING)
    off = balls - STANDING
    assert not missed.any()
    assert np.std(off[:, :3]) == pytest.approx(0.01, rel=0.1)
    assert np.std(off[:, 3:]) == pytest.approx(0.2, rel=0.1)
    assert np.std(pressures - 0.5) == pytest.approx(0.03, rel=0.1)
    assert np.abs(np.mean(off[1:] * off[:-1], axis=0) / np.mean(off**2, axis=0)).max() < 0.25
    assert len({tuple(row) for row in off}) == STEPS  # no block comes twice


def test_a_missed_ball_stays_where_it_was_seen_last() -> None:
    noise = NoiseSettings(missed_frames=0.3)
    balls = STANDING + 0.01 * np.arange(STEPS)[:, None]
    observed, missed, _ = perceived(noise, balls)
    assert 0.2 < missed.mean() < 0.4
    assert not missed[0]
    for step in range(STEPS):
        seen_last = np.flatnonzero(~missed[: step + 1])[-1]
        np.testing.assert_array_equal(observed[step], balls[seen_last])


@pytest.mark.parametrize("latency", [0.004, 0.01, 0.025])
def test_a_late_ball_is_where_it_was(latency: float) -> None:
    launch = SimulatedShots().launch(2)
    flight = predict(launch.position, launch.velocity, 0.5, spin=launch.spin)
    balls = np.hstack([flight.positions, flight.velocities])
    observed, _, _ = perceived(NoiseSettings(latency=latency), balls)
    fine = predict(launch.position, launch.velocity, 0.5, spin=launch.spin, period=0.001)
    for step in range(3, 50):
        true = round(1000 * (0.01 * step - latency))
        np.testing.assert_allclose(observed[step, :3], fine.positions[true], atol=1e-5)
        np.testing.assert_allclose(observed[step, 3:], fine.velocities[true], atol=1e-3)
    # before the first step, the ball was on its way
    assert observed[0, 1] == pytest.approx(balls[0, 1] - latency * balls[0, 4], abs=1e-6)


def played(task: TaskSettings, steps: int = 30) -> list[Any]:
    with closing(opened(task=task)) as environment:
        outcomes: list[Any] = [environment.reset(seed=3)[0]]
        outcomes += [environment.step(PUSH)[0] for _ in range(steps)]
        return outcomes


def test_the_same_seed_gives_the_same_ball_with_and_without_noise() -> None:
    exact = played(TaskSettings(balls="wide"))
    noisy = played(TaskSettings(balls="wide", noise=NoiseSettings.tracker()))
    again = played(TaskSettings(balls="wide", noise=NoiseSettings.tracker()))
    np.testing.assert_array_equal(noisy, again)
    off = np.array(noisy) - np.array(exact)
    np.testing.assert_array_equal(off[:, :16], 0.0)
    assert 0.003 < np.std(off[:, 16:19]) < 0.007
    assert 0.06 < np.std(off[:, 19:22]) < 0.14


def test_the_episode_is_judged_without_noise() -> None:
    def outcome(noise: NoiseSettings) -> tuple[float, int]:
        with closing(opened(task=TaskSettings(noise=noise))) as environment:
            environment.reset(seed=5)
            steps, over = 0, False
            while not over:
                _, reward, terminated, truncated, _ = environment.step(STILL)
                steps, over = steps + 1, terminated or truncated
            return float(reward), steps

    assert outcome(NoiseSettings()) == outcome(NoiseSettings(ball_position=0.1, ball_velocity=3.0))


def test_the_start_posture_is_spread() -> None:
    task = TaskSettings(noise=NoiseSettings(start_posture=0.1))
    with closing(opened(task=task)) as environment:
        starts = [environment.reset(seed=seed)[0][:4] for seed in range(6)]
    assert 0.02 < np.std(starts, axis=0).max() < 0.1


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"ball_position": -0.1}, "ball_position must be 0 or a positive number, got -0.1"),
        ({"latency": float("nan")}, "latency must be 0 or a positive number"),
        ({"missed_frames": 1.0}, "missed_frames must be below 1"),
        ({"latency": 0.5}, "latency must be at most 0.2 s"),
    ],
)
def test_wrong_noise_is_refused(wrong: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        NoiseSettings(**wrong)
