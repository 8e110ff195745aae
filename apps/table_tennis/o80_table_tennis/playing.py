"""Plays episodes with a policy, and evaluates policies on numbered balls."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import Any

import gymnasium

from .balls.sources import balls_from
from .environment import TableTennisEnvironment
from .players.conditions import Conditions
from .players.policies import Policy
from .report.episode_summary import EpisodeSummary
from .report.statistics import Played
from .settings import Pacing

VERDICT_SEED = 7_000_001
"""Seed of shots and noise of an evaluation."""
VERDICT_BALLS = 400


def play(
    environment: gymnasium.Env[Any, Any],
    policy: Policy,
    balls: Iterable[int],
    *,
    seed: int = 0,
    after_each: Callable[[EpisodeSummary], None] = lambda _: None,
) -> Played:
    """Plays an episode for each ball number. seed: of the first reset."""
    inner = environment.unwrapped
    if not isinstance(inner, TableTennisEnvironment):
        raise TypeError(f"only the table-tennis environments can be played, not {inner}")
    episodes = []
    begin = time.monotonic()
    for number, ball in enumerate(balls):
        observation, _ = environment.reset(
            seed=seed if number == 0 else None, options={"ball": ball}
        )
        policy.reset()
        over = False
        while not over:
            observation, _, terminated, truncated, _ = environment.step(policy.act(observation))
            over = terminated or truncated
        summary = inner.summary
        episodes.append(summary)
        after_each(summary)
    seconds = time.monotonic() - begin
    return Played(episodes=episodes, statistics=inner.statistics(), seconds=seconds)


def evaluate(
    policy: Policy,
    conditions: Conditions,
    *,
    balls: int | None = VERDICT_BALLS,
    seed: int = VERDICT_SEED,
    pacing: Pacing = Pacing.INLINE,
    after_each: Callable[[EpisodeSummary], None] = lambda _: None,
) -> Played:
    """Plays the first `balls` of the conditions' balls, each once; None: all of them."""
    task = conditions.task(ball_seed=seed)
    available = len(balls_from(task.balls, seed))
    count = available if balls is None else min(balls, available)
    with TableTennisEnvironment(rig=conditions.rig(pacing), task=task) as environment:
        played = play(environment, policy, range(count), seed=seed, after_each=after_each)
    return played
