"""Several workers that collect rollouts side by side: what is the same wherever they run."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from types import TracebackType
from typing import NamedTuple, Self

from o80.checked import whole
from o80.errors import Closed
from o80.learning.rollouts.rollout import Rollout
from o80.learning.rollouts.worker import Make, Policy, Spaces


class Replacement(NamedTuple):
    """A worker that was replaced."""

    iteration: int
    """In which the new one began."""
    worker: int


class Workers(ABC):
    """Workers 0 to W - 1, each with a vector environment of its own.

    A worker that is replaced begins anew: with a reset of all its copies, whose seeds follow from
    (seed, worker, the iteration under way). So two runs with the same seed, policies and
    replacements give the same rollouts, bit for bit.

    An exception in `collect` leaves some workers further than others: the next `collect` replaces
    them all, and repeats the iteration.
    """

    def __init__(
        self,
        make: Make,
        *,
        workers: int,
        seed: int = 0,
        iteration: int = 0,
        infos: Sequence[str] = (),
    ) -> None:
        """make: the vector environment of a worker, in autoreset mode SameStep.

        workers: how many. seed: of all random numbers.
        iteration: the first one; a training that resumes gives the one it has come to.
        infos: entries of Gymnasium's info that `Rollout.ends` keeps of each episode.
        """
        self.count = whole(workers, "workers", 1)
        self.seed = whole(seed, "seed", 0)
        self.iteration = whole(iteration, "iteration", 0)
        """That the next `collect` is for."""
        self.replacements: list[Replacement] = []
        """In the order in which they happened."""
        self._make, self._infos = make, tuple(infos)
        self._uneven = False  # whether some workers are further than others
        self._closed = False

    def collect(self, policy: Policy, *, steps: int) -> list[Rollout]:
        """A rollout of each worker, in their order; then the next iteration begins."""
        steps = whole(steps, "steps", 1)
        if self._closed:
            raise Closed("these workers were closed: make new ones")
        if self._uneven:
            for worker in range(self.count):
                self.replace(worker)
        self._uneven = True
        rollouts = self._collected(policy, steps)
        self._uneven = False
        self.iteration += 1
        return rollouts

    def replace(self, worker: int) -> None:
        """Ends a worker; a new one begins in the iteration under way."""
        if not 0 <= worker < self.count:
            raise IndexError(f"there are workers 0 to {self.count - 1}, not {worker}")
        self.replacements.append(Replacement(self.iteration, worker))
        self._replace(worker)

    def restart(self, iteration: int) -> None:
        """All workers begin anew, in `iteration`: for a training that resumes there."""
        self.iteration = whole(iteration, "iteration", 0)
        for worker in range(self.count):
            self.replace(worker)
        self._uneven = False

    @property
    @abstractmethod
    def spaces(self) -> Spaces:
        """Of the environments of one worker."""

    @abstractmethod
    def _collected(self, policy: Policy, steps: int) -> list[Rollout]:
        """The rollouts of the iteration under way."""

    @abstractmethod
    def _replace(self, worker: int) -> None:
        """Ends a worker and begins a new one."""

    @abstractmethod
    def _close(self) -> None:
        """Ends all workers."""

    def close(self) -> None:
        """Ends all workers; may be called twice."""
        if not self._closed:
            self._closed = True
            self._close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
