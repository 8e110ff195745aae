"""Observations and actions of several copies: arrays, or dicts and tuples of them."""

from typing import Any

import numpy as np
from gymnasium import Space, spaces

from o80.base.errors import InvalidArgument
from o80.learning.task import Index


def rows(batch: Any, copies: Any) -> Any:
    """Returns the entries of some copies as new arrays (of one copy for a single number)."""
    if isinstance(batch, dict):
        return {name: rows(each, copies) for name, each in batch.items()}
    if isinstance(batch, tuple):
        return tuple(rows(each, copies) for each in batch)
    chosen = batch[copies]
    return chosen.copy() if isinstance(chosen, np.ndarray) else chosen


def put(batch: Any, copies: Index, values: Any) -> None:
    """Overwrites the entries of some copies."""
    if isinstance(batch, dict):
        for name, each in batch.items():
            put(each, copies, values[name])
    elif isinstance(batch, tuple):
        for each, value in zip(batch, values, strict=True):
            put(each, copies, value)
    else:
        batch[copies] = values


def fresh(space: Space[Any], values: Any) -> Any:
    """Copies values into the types of `space`. Raises InvalidArgument for another shape."""
    if not isinstance(space, spaces.Box):  # seldom: the two questions below are slow
        if isinstance(space, spaces.Dict):
            return {name: fresh(each, values[name]) for name, each in space.items()}
        if isinstance(space, spaces.Tuple):
            return tuple(fresh(each, value) for each, value in zip(space, values, strict=True))
    made = np.array(values, space.dtype)
    if made.shape[1:] != space.shape:
        raise InvalidArgument(
            f"observations must have the shape (copies, {_numbers(space)}) of the observation "
            f"space, got {made.shape}"
        )
    return made


def checked_actions(space: Space[Any], actions: Any, copies: int) -> Any:
    """Converts actions of all copies to arrays. Raises InvalidArgument for a wrong shape."""
    if not isinstance(space, spaces.Box):
        if isinstance(space, spaces.Dict):
            return {
                name: checked_actions(each, actions[name], copies) for name, each in space.items()
            }
        if isinstance(space, spaces.Tuple):
            return tuple(
                checked_actions(each, action, copies)
                for each, action in zip(space, actions, strict=True)
            )
    given = np.asarray(actions)
    if given.shape != (copies, *(space.shape or ())):
        raise InvalidArgument(
            f"actions must have the shape {(copies, *(space.shape or ()))}, got {given.shape}"
        )
    return given


def batch_of_one(space: Space[Any], action: Any) -> Any:
    """Makes a batch of one copy's action. Raises InvalidArgument for a wrong shape."""
    if isinstance(space, spaces.Dict):
        return {name: batch_of_one(each, action[name]) for name, each in space.items()}
    if isinstance(space, spaces.Tuple):
        return tuple(batch_of_one(each, value) for each, value in zip(space, action, strict=True))
    given = np.asarray(action)
    if given.shape != space.shape:
        raise InvalidArgument(f"an action must have the shape {space.shape}, got {given.shape}")
    return given[np.newaxis]


def _numbers(space: Space[Any]) -> str:
    return ", ".join(map(str, space.shape or ()))
