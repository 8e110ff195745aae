"""A backend that a test iterates itself."""

from typing import Any, Self

import numpy as np
from processes import WAIT

import o80


class ManualBackend:
    """A backend and a frontend of it; its robot is at once where it is desired, at first at 0."""

    def __init__(self, segment: str, *described: Any, **options: Any) -> None:
        self.backend = o80.Backend(segment, *described, **options)
        self.backend.publish(np.zeros_like(self.backend._observed))
        self.frontend = o80.Frontend(segment)

    def run(self, iterations: int = 1) -> Any:
        """Iterates, bursting if it has to; the last desired states."""
        if self.frontend.bursting:
            self.frontend.burst(iterations, wait=False)
        for _ in range(iterations):
            desired = self.backend.step(WAIT)
            self.backend.publish(desired)
        return desired

    def desired(self, actuator: int | str | list[str], target: object) -> Any:
        """Desired states of the iteration that takes a set-point."""
        self.frontend.add_command(actuator, target)
        self.frontend.pulse()
        return self.run()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.frontend.forget_added()
        self.frontend.close()
        self.backend.close()
