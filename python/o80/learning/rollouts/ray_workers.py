"""Workers as Ray actors: processes on this machine and on others."""

from __future__ import annotations

import time
from typing import Any, Protocol

import o80
from o80.errors import Error, TimeoutError
from o80.extras import needed
from o80.learning.rollouts.ray_actor import About, RolloutActor
from o80.learning.rollouts.rollout import Rollout
from o80.learning.rollouts.worker import Make, Policy, Spaces
from o80.learning.rollouts.workers import Workers

ATTEMPTS = 3
"""Times that a worker is replaced in one iteration before `collect` gives up."""
CLOSING = 5.0
"""Time that actors have for closing their environments [s]."""


class Ask(Protocol):
    """Calls a method of an actor."""

    def __call__(self, actor: Any) -> Any: ...


class RayWorkers(Workers):
    """Workers as actors of Ray: their rollouts are those of LocalWorkers, bit for bit.

    An actor that dies, or whose machine does, is replaced during `collect`, and collects the same
    iteration. An exception of an environment or of a policy is raised as it is, with a note that
    names the worker.

    Connects to Ray as `ray.init()` does, unless the program has done so already.
    """

    def __init__(
        self, make: Make, *, processors: float = 1.0, timeout: float = 600.0, **options: Any
    ) -> None:
        """processors: that Ray reserves for each worker.

        timeout: within which all workers must have begun, or collected their rollouts [s].
        options: those of Workers.
        """
        super().__init__(make, **options)
        self._ray: Any = needed("ray", "ray", "rollouts on several machines")
        self._timeout, self._actor_processors = timeout, processors
        self._disconnects = not self._ray.is_initialized()
        if self._disconnects:
            self._ray.init()
        # pickled here: an actor that cannot load it can then say so
        self._pickled = self._ray.cloudpickle.dumps(make)
        actor = self._ray.remote(RolloutActor)
        self._actor = actor.options(num_cpus=processors, scheduling_strategy="SPREAD")
        self._actors: list[Any] = []
        try:
            self._actors = [self._new(worker) for worker in range(self.count)]
            about = self.about
            self._refuse_other_versions(about)
            self._spaces = about[0].spaces
        except BaseException:
            self.close()
            raise

    @property
    def about(self) -> list[About]:
        """Process and machine of each worker, now."""
        return self._of_all(lambda actor: actor.about.remote(), "begun")

    @property
    def spaces(self) -> Spaces:
        """Of the environments of one worker."""
        return self._spaces

    def _new(self, worker: int) -> Any:
        return self._actor.remote(
            self._pickled,
            worker=worker,
            seed=self.seed,
            iteration=self.iteration,
            infos=self._infos,
        )

    def _collected(self, policy: Policy, steps: int) -> list[Rollout]:
        shared = self._ray.put(policy)
        iteration = self.iteration
        return self._of_all(
            lambda actor: actor.collect.remote(shared, steps, iteration), "collected their rollouts"
        )

    def _of_all(self, ask: Ask, done: str) -> list[Any]:
        """The answers of all workers; those that die are replaced and asked again."""
        answers: list[Any] = [None] * self.count
        waiting = {ask(actor): worker for worker, actor in enumerate(self._actors)}
        lost = [0] * self.count
        end = time.monotonic() + self._timeout
        while waiting:
            left = max(0.0, end - time.monotonic())
            ready, _ = self._ray.wait(list(waiting), num_returns=1, timeout=left)
            if not ready:
                raise self._late(sorted(waiting.values()), done)
            worker = waiting.pop(ready[0])
            try:
                answers[worker] = self._ray.get(ready[0])
            except self._ray.exceptions.RayTaskError as error:
                raise _cause(error, worker) from error
            except self._ray.exceptions.RayError as error:
                lost[worker] += 1
                if lost[worker] > ATTEMPTS:
                    raise Error(
                        f"worker {worker} was replaced {ATTEMPTS} times in iteration "
                        f"{self.iteration} and died again: {error}"
                    ) from error
                self.replace(worker)
                waiting[ask(self._actors[worker])] = worker
        return answers

    def _late(self, workers: list[int], done: str) -> TimeoutError:
        asked, there = self._actor_processors * self.count, self._ray.cluster_resources()
        names = ", ".join(map(str, workers[:5])) + (", ..." if len(workers) > 5 else "")
        return TimeoutError(
            f"after {self._timeout:g} s {len(workers)} of {self.count} workers ({names}) have not "
            f"{done}: give timeout= more time, or look at `ray status`. The workers reserve "
            f"{asked:g} processors; Ray has {there.get('CPU', 0):g}"
        )

    def _refuse_other_versions(self, workers: list[About]) -> None:
        for worker, about in enumerate(workers):
            if about.version != o80.__version__:
                raise Error(
                    f"worker {worker} on {about.machine} has o80 {about.version}, this process has "
                    f"{o80.__version__}: install the same version on all machines"
                )

    def _replace(self, worker: int) -> None:
        self._ray.kill(self._actors[worker])
        self._actors[worker] = self._new(worker)

    def _close(self) -> None:
        if self._ray.is_initialized():
            closing = [actor.close.remote() for actor in self._actors]
            if closing:
                self._ray.wait(closing, num_returns=len(closing), timeout=CLOSING)
            for actor in self._actors:
                self._ray.kill(actor)
        if self._disconnects:
            self._ray.shutdown()


def _cause(error: Any, worker: int) -> BaseException:
    """The exception that a worker raised."""
    cause: BaseException = error.cause
    cause.add_note(f"raised in rollout worker {worker}")
    return cause
