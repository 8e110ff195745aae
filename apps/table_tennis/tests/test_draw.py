"""Which balls the episodes play."""

from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recorded_rows import simulated_shot, write_shots

from o80_table_tennis.balls.simulated_shots import SimulatedShots
from o80_table_tennis.balls.sources import balls_from
from o80_table_tennis.environment import TableTennisEnvironment
from o80_table_tennis.episode_draw import USERS_OWN, EpisodeDraw, drawn_episode
from o80_table_tennis.settings import TaskSettings
from o80_table_tennis.task.ball_play import ReturnTask


def drawn(shots: SimulatedShots, seed: int, **options: Any) -> EpisodeDraw:
    return drawn_episode(ReturnTask(), shots, np.random.default_rng(seed), **options)


def test_every_episode_draws_another_shot_and_the_seed_repeats_them() -> None:
    def begun(task: TaskSettings) -> list[list[float]]:
        with closing(TableTennisEnvironment(task=task)) as environment:
            seeds = [4, None, None, None, None, None]
            return [environment.reset(seed=seed)[0][16:].tolist() for seed in seeds]

    wide = begun(TaskSettings(balls="wide"))
    assert len({tuple(ball) for ball in wide}) == 6
    assert begun(TaskSettings(balls="wide")) == wide
    assert begun(TaskSettings(balls="wide", ball_seed=1)) != wide
    counted = begun(TaskSettings(balls="wide", ball_count=2))
    assert len({tuple(ball) for ball in counted}) == 2


@pytest.mark.parametrize("ball", range(6))
def test_no_ball_is_drawn_twice_where_there_are_enough(ball: int) -> None:
    shots = SimulatedShots(count=6)
    for seed in range(20):
        for played in (None, ball):
            found = drawn(shots, seed, extra=5, ball=played)
            assert sorted(found.numbers) == list(range(6))
            assert played in (None, found.numbers[0])
    assert len(drawn(shots, 0, extra=9).flights) == 10


def test_what_the_caller_chooses_changes_no_other_draw() -> None:
    shots, flight = SimulatedShots(), SimulatedShots(seed=9).flight(0)
    states = []
    for chosen in ({}, {"ball": 3}, {"flight": flight}):
        found = drawn(shots, 2, extra=2, **chosen)
        states.append((found.numbers[1:], found.arm_seed, found.twin_seed))
    assert states[0] == states[1] == states[2]
    assert found.numbers[0] == USERS_OWN


def test_balls_are_named_or_read_from_a_path(tmp_path: Path) -> None:
    assert len(balls_from("wide", count=400)) == 400
    assert len(balls_from(None)) == len(balls_from("narrow")) > 10**9
    with pytest.raises(FileNotFoundError, match="or the name of simulated shots: narrow, wide"):
        balls_from("wid")
    shots = {"0": simulated_shot(np.random.default_rng(0))}
    file = str(write_shots(tmp_path / "shots.hdf5", shots))
    assert len(balls_from(file)) == 1
    with pytest.raises(ValueError, match="ball_count=3 is for simulated shots"):
        balls_from(file, count=3)
