"""Arms and twins of a vector environment, in two inline groups."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from typing import Any

import numpy as np
from numpy.typing import NDArray

import o80
from o80.base.arrays import Float32Array, FloatArray
from o80.learning import Index

from ..settings import RigSettings
from ..task.observations import BALL_POSITION, PRESSURES, SIZE
from .arm import MOTION, Arms
from .robot_options import arm_options, twin_options
from .twin import Flights, Twins

LANE_BLOCKS = 2048
"""Blocks of 64 bytes in a lane of a twin: the states of a recorded flight are one batch."""
MIRRORED = dict(zip(("position", "velocity"), MOTION, strict=True))
"""Fields of the joints of a twin, each with its path in the rows of the arm."""


class GroupRig:
    """N arms, each with the twin that mirrors it; what an inline `Rig` is for one."""

    lateness = 0
    """Rows that the arms have made since the ones used last."""

    def __init__(
        self, copies: int, settings: RigSettings, *, delay: int, threads: int | None = None
    ) -> None:
        """delay: iterations from the beginning of a step until its pressures act."""
        # nobody takes snapshots of the copies: their memory would be most of a copy's
        common: dict[str, Any] = {"frequency": settings.frequency, "slots": 0}
        with ExitStack() as stack:
            arms = o80.robots.load("pam").inline(
                copies=copies, threads=threads, **common, **arm_options(settings)
            )
            stack.enter_context(arms)
            twins = o80.robots.load("mujoco").inline(
                copies=copies,
                threads=arms,
                lane_blocks=LANE_BLOCKS,
                **common,
                **twin_options(settings),
            )
            stack.enter_context(twins)
            self.arm, self.twin = Arms(arms, delay=delay), Twins(twins)
            self.robots = arms, twins
            """Their halts end episodes."""
            self._step = self.arm.burst.then(self.twin.burst, MIRRORED)
            self._stack = stack.pop_all()

    def reset(
        self,
        copies: NDArray[np.intp],
        *,
        arm_seeds: list[int],
        twin_seeds: list[int],
        flights: Sequence[Flights],
    ) -> None:
        """These arms and twins to the start; the balls fly from the next step on."""
        self.arm.reset(copies, arm_seeds)
        self.twin.reset(copies, twin_seeds, self.arm.last_motion[copies], flights)

    def see_newest(self) -> None:
        """Nothing: a burst that a halt has ended shows the last row."""

    def step(self, pressures: FloatArray, copies: Index) -> None:
        """These arms are asked for normalised pressures (n, 8); five rows of each."""
        self.arm.ask(pressures, copies)
        self._step.run(copies)

    def gather(self, low: Float32Array, high: Float32Array) -> list[Float32Array]:
        """Parts (N, ...) of the observation of ball play, within its bounds (22,): C++ fills them
        in in each step and reset.
        """
        arm, ball = slice(0, PRESSURES.stop), slice(BALL_POSITION.start, SIZE)
        return [self.arm.gather(low[arm], high[arm]), self.twin.gather(low[ball], high[ball])]

    def twin_of(self, copy: int) -> o80.Frontend:
        """Frontend of the twin of a copy."""
        return self.twin.group[copy]

    def close(self) -> None:
        """Ends arms and twins; may be called twice."""
        self._stack.close()
