"""What an actor of Ray runs: a worker, and where it lives."""

from __future__ import annotations

import os
import pickle
import socket
from typing import Any, NamedTuple

import o80
from o80.learning.rollouts.rollout import Rollout
from o80.learning.rollouts.worker import Policy, Spaces, Worker


class About(NamedTuple):
    """Where a worker lives."""

    machine: str
    """Name of the host."""
    process: int
    version: str
    """Of o80 there."""
    spaces: Spaces
    """Of its environments."""


class RolloutActor:
    """The methods of an actor; RayWorkers calls them from afar."""

    def __init__(self, make: bytes, **options: Any) -> None:
        """make: pickled. options: those of Worker."""
        self._make, self._options = make, options
        self._begun: Worker | None = None

    def about(self) -> About:
        """Begins."""
        spaces = self._worker().spaces
        return About(socket.gethostname(), os.getpid(), o80.__version__, spaces)

    def collect(self, policy: Policy, steps: int, iteration: int) -> Rollout:
        """The rollout of an iteration."""
        return self._worker().collect(policy, steps=steps, iteration=iteration)

    def close(self) -> None:
        """Closes the environments."""
        if self._begun is not None:
            self._begun.close()

    def _worker(self) -> Worker:
        # not in the constructor: Ray could not tell its exceptions from a death
        if self._begun is None:
            self._begun = Worker(pickle.loads(self._make), **self._options)
        return self._begun
