"""A rollout: data of several copies of an environment under one policy, as arrays."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Ends:
    """The E episodes that ended in a rollout, sorted by step, then by copy."""

    steps: NDArray[np.int64]  #: (E,) the step of the rollout in which the episode ended
    copies: NDArray[np.int64]  #: (E,) the copy
    rewards: NDArray[np.float64]  #: (E,) sum over the episode, earlier rollouts included
    lengths: NDArray[np.int64]  #: (E,) steps of the episode, earlier rollouts included
    observations: NDArray[Any]
    """(E, ...) last observation of the episode, before the reset: a learner bootstraps truncated
    episodes from it."""
    infos: Mapping[str, NDArray[Any]]
    """(E, ...) the requested entries of Gymnasium's info."""


@dataclass(frozen=True, eq=False)
class Rollout:
    """T steps of N copies. All arrays are read-only."""

    observations: NDArray[Any]
    """(T + 1, N, ...) before each step; the next rollout begins with the last ones."""
    actions: NDArray[Any]
    """(T, N, ...) as drawn by the policy, before they were clipped into the action space."""
    log_probabilities: NDArray[np.float64]  #: (T, N) of the actions, under the policy
    rewards: NDArray[np.float64]  #: (T, N)
    terminated: NDArray[np.bool_]  #: (T, N) the task ended the episode in this step
    truncated: NDArray[np.bool_]  #: (T, N) the episode was truncated after this step
    ends: Ends


def arrays_of(value: Any, name: str = "") -> Iterator[tuple[str, NDArray[Any]]]:
    """Yields all arrays of a rollout with their names, such as "ends.rewards"."""
    if isinstance(value, np.ndarray):
        yield name, value
    elif isinstance(value, Rollout | Ends):
        for each in fields(value):
            yield from arrays_of(getattr(value, each.name), f"{name}.{each.name}".lstrip("."))
    elif isinstance(value, Mapping):
        for key, entry in value.items():
            yield from arrays_of(entry, f"{name}[{key!r}]")
