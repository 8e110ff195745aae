"""Playing episodes with a policy."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import Any

import gymnasium

from .environment import TableTennisEnvironment
from .players.policies import Policy
from .report.episode_summary import EpisodeSummary
from .report.statistics import Played


def play(
    environment: gymnasium.Env[Any, Any],
    policy: Policy,
    balls: Iterable[int],
    *,
    seed: int = 0,
    after_each: Callable[[EpisodeSummary], None] = lambda _: None,
) -> Played:
    """Plays one episode for each number of a ball; `seed` is that of the first reset."""
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
