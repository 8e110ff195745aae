"""Workers in this process."""

from __future__ import annotations

from typing import Any

from o80.learning.rollouts.rollout import Rollout
from o80.learning.rollouts.worker import Make, Policy, Spaces, Worker
from o80.learning.rollouts.workers import Workers


class LocalWorkers(Workers):
    """Workers in this process, one after the other.

    For a training on one processor, for debugging, and to repeat what RayWorkers did.
    """

    def __init__(self, make: Make, **options: Any) -> None:
        """options: those of Workers."""
        super().__init__(make, **options)
        self._workers: list[Worker] = []
        try:
            for worker in range(self.count):
                self._workers.append(self._new(worker))
        except BaseException:
            self.close()
            raise

    def _new(self, worker: int) -> Worker:
        return Worker(
            self._make,
            worker=worker,
            seed=self.seed,
            iteration=self.iteration,
            infos=self._infos,
        )

    @property
    def spaces(self) -> Spaces:
        """Of the environments of one worker."""
        return self._workers[0].spaces

    def _collected(self, policy: Policy, steps: int) -> list[Rollout]:
        rollouts = []
        for number, worker in enumerate(self._workers):
            try:
                rollouts.append(worker.collect(policy, steps=steps, iteration=self.iteration))
            except Exception as error:
                error.add_note(f"raised in rollout worker {number}")
                raise
        return rollouts

    def _replace(self, worker: int) -> None:
        self._workers[worker].close()
        self._workers[worker] = self._new(worker)

    def _close(self) -> None:
        for each in self._workers:
            each.close()
