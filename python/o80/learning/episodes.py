"""The order of a step and of a reset, which the environments of one copy and of many share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.base.errors import InvalidArgument
from o80.learning.batches import fresh
from o80.learning.task import Index, Outcome, Task


@dataclass(slots=True)
class Begun:
    """Observations of n copies when their episodes begin."""

    observations: Any
    """(n, ...) a fresh batch."""
    info: Mapping[str, Any]
    """(n, ...)"""


@dataclass(slots=True)
class Stepped(Begun):
    """Observations of n copies after a step; its rewards and ends in arrays over all copies."""

    rewards: NDArray[np.float64]
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    judged: NDArray[np.intp]
    """Numbers of the copies that were judged."""
    judged_info: Mapping[str, Any]
    """Info of the judged copies."""


def begin(
    task: Task,
    copies: NDArray[np.intp],
    generators: Sequence[np.random.Generator],
    options: dict[str, Any] | None,
) -> Begun:
    """Begins an episode of some copies."""
    task.steps[copies] = 0
    task.begin(copies, generators, options or {})
    info = task.info(copies)
    return Begun(fresh(task.observation_space, task.observe(copies)), info)


def step(task: Task, actions: Any, copies: Index) -> Stepped:
    """A step of some copies."""
    task.step(actions, copies)
    task.steps[copies] += 1
    rewards = np.zeros(task.copies)
    terminated, truncated = np.zeros(task.copies, np.bool_), np.zeros(task.copies, np.bool_)
    judged_info: Mapping[str, Any] = {}
    judged, late = _to_be_judged(task, copies)
    if judged.size:
        outcome: object = task.judge(judged)
        if not isinstance(outcome, Outcome):
            name = type(task).__name__
            raise InvalidArgument(f"{name}.judge must return an Outcome, got {outcome!r}")
        rewards[judged] = outcome.reward
        terminated[judged] = outcome.terminated
        truncated[judged] = outcome.truncated
        if late is not None:
            truncated |= late
        judged_info = outcome.info
    info = task.info(copies)
    observations = fresh(task.observation_space, task.observe(copies))
    return Stepped(observations, info, rewards, terminated, truncated, judged, judged_info)


def no_step(task: Task) -> Stepped:
    """Result of a step of no copy."""
    nothing = np.zeros(task.copies, np.bool_)
    return Stepped(
        None, {}, np.zeros(task.copies), nothing, nothing.copy(), np.zeros(0, np.intp), {}
    )


def _to_be_judged(task: Task, copies: Index) -> tuple[NDArray[np.intp], NDArray[np.bool_] | None]:
    """Numbers of the copies to be judged, and which of all are out of steps (None: no limit)."""
    flagged, late = task.flagged(), None
    if task.max_steps is not None:
        late = task.steps >= task.max_steps
        flagged = flagged | late
    if not isinstance(copies, slice):
        stepped = np.zeros(task.copies, np.bool_)
        stepped[copies] = True
        flagged = flagged & stepped
        late = None if late is None else late & stepped
    return flagged.nonzero()[0], late
