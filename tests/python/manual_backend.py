"""Backend that a test iterates."""

from typing import Any, Self

import numpy as np
from processes import WAIT

import o80


class ManualBackend:
    """A backend and its frontend; observed states equal the desired ones, at first 0."""

    def __init__(self, segment: str, *described: Any, **options: Any) -> None:
        self.backend = o80.Backend(segment, *described, **options)
        self.backend.publish(np.zeros_like(self.backend._observed))
        self.frontend = o80.Frontend(segment)

    def run(self, iterations: int = 1) -> Any:
        """Iterates, by bursts if necessary; returns the last desired states."""
        if self.frontend.bursting:
            self.frontend.burst(iterations, wait=False)
        for _ in range(iterations):
            desired = self.backend.step(WAIT)
            self.backend.publish(desired)
        return desired

    def desired(self, actuator: int | str | list[str], target: object) -> Any:
        """Sends a set-point; returns the desired states of its iteration."""
        self.frontend.add_command(actuator, target)
        self.frontend.pulse()
        return self.run()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.frontend.forget_added()
        self.frontend.close()
        self.backend.close()
