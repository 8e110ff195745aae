"""The table-tennis environments: one step order in all modes, episodes, nothing left."""

from collections.abc import Iterator
from contextlib import closing

import numpy as np
import pytest
from opened_environment import PUSH, STILL, opened, played_out

from o80_table_tennis.balls.simulated_shots import SimulatedShots
from o80_table_tennis.balls.sources import balls_from
from o80_table_tennis.environment import TableTennisEnvironment
from o80_table_tennis.settings import Pacing, TaskSettings
from o80_table_tennis.task.actions import COARSE, changed_pressures
from o80_table_tennis.task.end import End, EndRule
from o80_table_tennis.world.arm import MUSCLES
from o80_table_tennis.world.timing import ITERATIONS, PERIOD


@pytest.fixture
def inline() -> Iterator[TableTennisEnvironment]:
    with closing(opened()) as environment:
        yield environment


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_an_action_acts_from_the_iteration_it_is_meant_for(delay: int) -> None:
    task = TaskSettings(factor=COARSE, delay=delay)
    with closing(opened(task=task)) as environment:
        environment.reset(seed=1)
        arm, of_task = environment.arm, environment.task
        k, before = arm.published, of_task.commanded()[0]
        environment.step(PUSH)
        commanded = arm.history(since=k + 1, until=k + ITERATIONS).desired

        start = of_task.home_of_arm.pressures
        wanted = of_task.range.raw(changed_pressures(before, PUSH, factor=COARSE))
        np.testing.assert_array_equal(commanded[:delay], np.tile(start, (delay, 1)))
        np.testing.assert_array_equal(commanded[delay:], np.tile(wanted, (ITERATIONS - delay, 1)))


@pytest.mark.parametrize("pacing", [Pacing.INLINE, Pacing.PROCESSES])
def test_a_step_that_repeats_its_action_is_several_steps_with_this_action(pacing: Pacing) -> None:
    seen = []
    for repeat, steps in ((1, 6), (3, 2)):
        task = TaskSettings(factor=COARSE, repeat=repeat)
        with closing(opened(pacing, task=task)) as environment:
            environment.reset(seed=1)
            for _ in range(steps):
                observation, *_ = environment.step(0.1 * PUSH)
            arm, twin = environment.arm, environment.twins[0]
            histories = [each.history() for each in (arm, twin)]
            moved = [
                each.rows[["iteration", "desired", "observed"]].tobytes() for each in histories
            ]
            seen.append((moved, observation.tobytes()))
            assert environment.statistics().steps == repeat * steps
    assert seen[0] == seen[1]


def test_the_ball_starts_with_the_first_step(inline: TableTennisEnvironment) -> None:
    flight = SimulatedShots().launch(7).seen(duration=0.2, period=PERIOD)
    observation, _ = inline.reset(seed=1, options={"ball": 7})
    np.testing.assert_allclose(observation[16:19], flight.positions[0], rtol=1e-6)
    np.testing.assert_allclose(observation[19:22], flight.velocities[0], rtol=1e-6)
    for step in range(1, 10):
        observation, *_ = inline.step(STILL)
        np.testing.assert_allclose(observation[16:19], flight.positions[5 * step], rtol=1e-5)


def test_the_observation_is_the_state_after_the_action(inline: TableTennisEnvironment) -> None:
    inline.reset(seed=1)
    observation, *_ = inline.step(PUSH)
    row = inline.arm.latest()

    np.testing.assert_array_equal(observation[:4], row.extended.joint_positions.astype(np.float32))
    normalised = inline.task.range.normalised(np.array(row.observed))
    np.testing.assert_allclose(observation[8:16], normalised, rtol=1e-6)


def test_a_missed_ball_costs_how_far_it_was_missed(inline: TableTennisEnvironment) -> None:
    inline.reset(seed=1, options={"ball": 0})
    steps = played_out(inline)

    assert [reward for _, reward, *_ in steps[:-1]] == [0.0] * (len(steps) - 1)
    _, reward, terminated, truncated, info = steps[-1]
    assert (terminated, truncated, info["touched"]) == (True, False, False)
    assert reward == -info["smallest_distance"] < 0
    assert info["end"] in (End.PASSED, End.FLOOR)
    assert info["end_text"] in ("passed", "floor")
    assert {type(value) for value in info.values()} == {bool, int, float, str, np.ndarray}
    distances = [info["smallest_distance"] for *_, info in steps]
    assert distances == sorted(distances, reverse=True)


def test_an_episode_out_of_steps_is_truncated_and_paid_nothing() -> None:
    task = TaskSettings(end=EndRule(max_steps=12))
    with closing(opened(task=task)) as environment:
        environment.reset(seed=1)
        steps = played_out(environment)

        _, reward, terminated, truncated, info = steps[-1]
        assert (len(steps), terminated, truncated) == (12, False, True)
        assert (info["end"], info["end_text"]) == (End.OUT_OF_STEPS, "out of steps")
        assert reward == 0.0 < info["smallest_distance"]


def test_a_ball_is_chosen_by_number_or_as_a_flight(inline: TableTennisEnvironment) -> None:
    by_number, _ = inline.reset(seed=1, options={"ball": 3})
    by_flight, _ = inline.reset(seed=1, options={"flight": balls_from(None).flight(3)})
    np.testing.assert_array_equal(by_number, by_flight)


def test_extra_balls_are_judged_as_if_each_were_played_alone() -> None:
    actions = np.random.default_rng(4).uniform(-1, 1, (300, MUSCLES)).astype(np.float32)
    with closing(opened(worlds=6)) as environment:
        environment.reset(seed=5)
        balls, played = environment.task.draws[0].numbers, 0
        paid, ended_after = np.zeros(6), np.zeros(6, dtype=int)
        over = False
        while not over:
            _, _, terminated, truncated, info = environment.step(actions[played])
            played += 1
            each = info["worlds"]
            assert each["observation"].shape == (6, 22)
            paid += each["reward"]
            ended = each["terminated"] | each["truncated"]
            ended_after[ended & (ended_after == 0)] = played
            over = terminated or truncated
        assert (ended_after > 0).all()

    # those whose own end came before that of the ball that was played
    whole = np.flatnonzero(ended_after < played)
    with closing(opened()) as alone:
        for ball in whole:
            alone.reset(seed=5, options={"ball": int(balls[ball])})
            for step in range(ended_after[ball]):
                _, reward, terminated, _, info = alone.step(actions[step])
            assert terminated
            assert reward == pytest.approx(paid[ball], abs=1e-6)
            assert info["touched"] == each["touched"][ball]
