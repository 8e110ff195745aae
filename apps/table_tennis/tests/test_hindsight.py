"""Transitions of motions, the choice of balls, and the buffer that holds them."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given, settings
from hypothesis import strategies as st

from o80_table_tennis.learning.virtual.buffer import MotionBuffer
from o80_table_tennis.learning.virtual.hindsight import (
    Transitions,
    best_balls,
    every_ball,
    transitions,
)
from o80_table_tennis.learning.virtual.motions import Motion

pytestmark = pytest.mark.check  # needs torch, which only `make check` installs

BOX = spaces.Box(-np.inf, np.inf, (2,), np.float32)
ACTIONS = spaces.Box(-1, 1, (8,), np.float32)


@st.composite
def made_motions(draw: st.DrawFn) -> Motion:
    """Observations are (step, ball), so that each is known again."""
    lengths = np.array(draw(st.lists(st.integers(1, 6), min_size=1, max_size=5)))
    steps, balls = int(lengths.max()), len(lengths)
    observations = np.empty((steps + 1, balls, 2), np.float32)
    observations[..., 0] = np.arange(steps + 1)[:, None]
    observations[..., 1] = np.arange(balls)
    rewards = np.zeros((steps, balls), np.float32)
    paid = draw(st.lists(st.integers(-3, 3), min_size=balls, max_size=balls))
    rewards[lengths - 1, np.arange(balls)] = paid
    flags = st.lists(st.booleans(), min_size=balls, max_size=balls)
    terminated = np.array(draw(flags))
    return Motion(
        observations,
        np.repeat(np.arange(steps, dtype=np.float32)[:, None], 8, axis=1),
        rewards,
        lengths,
        terminated,
        np.array(draw(flags)),
        np.array(draw(flags)),
        np.arange(balls),
    )


@settings(deadline=None)
@given(made_motions(), st.data())
def test_each_chosen_ball_gives_its_whole_episode_and_no_other_does(
    motion: Motion, data: st.DataObject
) -> None:
    count = len(motion.lengths)
    balls = np.array(data.draw(st.lists(st.integers(0, count - 1), min_size=1, unique=True)))
    made = transitions(motion, balls)
    expected = [(step, ball) for ball in balls for step in range(motion.lengths[ball])]
    assert made.observations.tolist() == [[step, ball] for step, ball in expected]
    assert made.next_observations.tolist() == [[step + 1, ball] for step, ball in expected]
    assert made.actions[:, 0].tolist() == [step for step, _ in expected]
    assert made.rewards.tolist() == [motion.rewards[step, ball] for step, ball in expected]
    assert made.terminated.tolist() == [
        step == motion.lengths[ball] - 1 and motion.terminated[ball] for step, ball in expected
    ]


@settings(deadline=None)
@given(made_motions(), st.integers(0, 6))
def test_the_best_are_the_played_ball_and_those_that_were_paid_most(
    motion: Motion, count: int
) -> None:
    chosen = best_balls(count)(motion).tolist()
    others = sorted(set(range(len(motion.lengths))) - set(chosen))
    assert chosen[0] == 0
    assert len(chosen) == len(set(chosen)) == 1 + min(count, len(motion.lengths) - 1)
    paid = motion.paid
    assert all(paid[ball] >= paid[other] for ball in chosen[1:] for other in others)
    assert every_ball(motion).tolist() == list(range(len(motion.lengths)))


def some(numbers: range) -> Transitions:
    """Transitions that are known by their number."""
    column = np.array(numbers, np.float32)
    return Transitions(
        np.stack([column, column + 0.25], axis=1),
        np.repeat(column[:, None], 8, axis=1),
        column,
        np.stack([column, column + 0.5], axis=1),
        column % 2 == 1,
    )


@settings(deadline=None)
@given(st.lists(st.integers(0, 10), min_size=1, max_size=12))
def test_the_buffer_holds_the_newest_transitions_each_of_one_piece(counts: list[int]) -> None:
    buffer, given = MotionBuffer(10, BOX, ACTIONS), 0
    for count in counts:
        buffer.extend(some(range(given, given + count)))
        given += count
    assert buffer.size() == min(given, 10)
    if not given:
        return
    np.random.seed(0)  # noqa: NPY002 - the buffer draws from it
    drawn: Any = SimpleNamespace(**buffer.sample(400)._asdict())
    numbers = drawn.rewards[:, 0].numpy()
    assert set(numbers.tolist()) == set(range(max(0, given - 10), given))
    assert np.array_equal(drawn.observations.numpy(), np.stack([numbers, numbers + 0.25], axis=1))
    assert np.array_equal(
        drawn.next_observations.numpy(), np.stack([numbers, numbers + 0.5], axis=1)
    )
    assert np.array_equal(drawn.actions[:, 0].numpy(), numbers)
    assert np.array_equal(drawn.dones[:, 0].numpy(), numbers % 2)


def test_a_motion_larger_than_the_buffer_is_refused() -> None:
    with pytest.raises(ValueError, match="11 transitions does not fit into a buffer of 10"):
        MotionBuffer(10, BOX, ACTIONS).extend(some(range(11)))
