"""Runs the parts of a step and of a reset in order, for one copy and for many."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.base.errors import InvalidArgument
from o80.learning.batches import fresh
from o80.learning.group_task import GroupTask
from o80.learning.halts import halts_of
from o80.learning.task import EVERY, Index, Outcome, Task

_NOBODY: NDArray[np.intp] = np.zeros(0, np.intp)


@dataclass(slots=True)
class Begun:
    """Observations of n copies at the begin of their episodes."""

    observations: Any  #: (n, ...) a fresh batch
    info: Mapping[str, Any]  #: (n, ...)


@dataclass(slots=True)
class Stepped(Begun):
    """Result of a step of n copies: their observations; rewards and end flags of all copies."""

    rewards: NDArray[np.float64]
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    judged: NDArray[np.intp]  #: numbers of the copies that were judged
    judged_info: Mapping[str, Any]  #: info of the judged copies
    halted: NDArray[np.intp]  #: numbers of the copies that are halted; they were judged too
    halt_info: Mapping[str, Any]  #: info of the halted copies


def begin(
    task: Task,
    copies: NDArray[np.intp],
    generators: Sequence[np.random.Generator],
    options: dict[str, Any] | None,
) -> Begun:
    """Begins an episode of some copies."""
    task.steps[copies] = 0
    task.restart(copies, generators, options or {})
    observed, info = task.shown(copies)
    return Begun(fresh(task.observation_space, observed), info)


def step(task: Task, actions: Any, copies: Index) -> Stepped:
    """Runs a step of some copies."""
    # with one copy an incomplete step affects no other copy
    if task.copies == 1:
        with task.until_halted():
            task.step(actions, copies)
    else:
        task.step(actions, copies)
    return _stepped(task, copies)


def step_others(
    task: GroupTask,
    actions: Any,
    beginning: NDArray[np.intp],
    generators: Sequence[np.random.Generator],
) -> Stepped:
    """Runs a step of some copies while all others begin an episode; returns what all show."""
    task.steps[beginning] = 0
    task.begin(beginning, generators, {})
    mask = np.zeros(task.copies, np.bool_)
    mask[beginning] = True
    task.step_others(actions, mask)
    return _stepped(task, EVERY, ~mask)


def _stepped(task: Task, copies: Index, stepped: NDArray[np.bool_] | None = None) -> Stepped:
    """Judges these copies after a step, except those that are not `stepped` (copies,)."""
    halted = _halted(task, copies)
    one = 1 if stepped is None else stepped
    if copies is EVERY:
        task.steps += one
    else:
        task.steps[copies] += one
    rewards = np.zeros(task.copies)
    terminated, truncated = np.zeros(task.copies, np.bool_), np.zeros(task.copies, np.bool_)
    judged_info: Mapping[str, Any] = {}
    judged, late = _to_be_judged(task, copies, halted, stepped)
    if judged.size:
        outcome: object = task.outcome(judged)
        if not isinstance(outcome, Outcome):
            name = type(task).__name__
            raise InvalidArgument(f"{name}.judge must return an Outcome, got {outcome!r}")
        reward = outcome.reward
        _put(rewards, judged, reward, task, "reward")
        whole = math.isfinite(reward) if type(reward) is float else np.isfinite(rewards).all()
        if not whole:
            copy = int(np.flatnonzero(~np.isfinite(rewards))[0])
            raise InvalidArgument(
                f"{type(task).__name__}.judge gave copy {copy} the reward {rewards[copy]}: it must "
                "be finite, because any other value breaks the policy that learns from it"
            )
        _put(terminated, judged, outcome.terminated, task, "terminated")
        if halted.size:
            terminated[halted] = True
        _put(truncated, judged, outcome.truncated, task, "truncated")
        if late is not None:
            truncated[judged] |= late[judged]
        judged_info = outcome.info
    observed, info = task.shown(copies)
    return Stepped(
        fresh(task.observation_space, observed),
        info,
        rewards,
        terminated,
        truncated,
        judged,
        judged_info,
        halted,
        {"halt": [task.halts[copy] for copy in halted.tolist()]} if halted.size else {},
    )


def _put(all_copies: Any, judged: NDArray[np.intp], given: Any, task: Task, name: str) -> None:
    try:
        all_copies[judged] = given
    except (TypeError, ValueError, OverflowError):
        raise InvalidArgument(
            f"{type(task).__name__}.judge must give {name} as one value, or one for each of the "
            f"{judged.size} judged copies, got {given!r}"
        ) from None


def no_step(task: Task) -> Stepped:
    """Returns the result of a step of no copy."""
    nothing = np.zeros(task.copies, np.bool_)
    return Stepped(
        None, {}, np.zeros(task.copies), nothing, nothing.copy(), _NOBODY, {}, _NOBODY, {}
    )


def _halted(task: Task, copies: Index) -> NDArray[np.intp]:
    """Returns the numbers of the copies that are halted after a step."""
    task.halts = halts = halts_of(task.robots, task.copies)
    if not halts:
        return _NOBODY
    halted = np.array(sorted(halts), np.intp)
    return halted if isinstance(copies, slice) else np.intersect1d(halted, copies)


def _to_be_judged(
    task: Task, copies: Index, halted: NDArray[np.intp], stepped: NDArray[np.bool_] | None
) -> tuple[NDArray[np.intp], NDArray[np.bool_] | None]:
    """Returns copies to judge, and a mask of copies that are out of steps (None: no limit)."""
    flagged, late = task.flagged(), None
    if halted.size:
        flagged = flagged.copy()
        flagged[halted] = True
    if task.max_steps is not None:
        late = task.steps >= task.max_steps
        flagged = flagged | late
    if not isinstance(copies, slice):
        stepped = np.zeros(task.copies, np.bool_)
        stepped[copies] = True
    if stepped is not None:
        flagged = flagged & stepped
    return flagged.nonzero()[0], late
