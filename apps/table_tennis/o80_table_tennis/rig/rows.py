"""Newest rows of arms and worlds, with names for the task."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

import o80
from o80.base.arrays import Float32Array, FloatArray
from o80.rows.layout import field_view

from ..task.ball_record import BallRecord
from ..task.observations import BALL_POSITION, PRESSURES, SIZE
from ..world.arm import JOINTS
from .ball_records import BallRecords, event_flags
from .pressure_range import PressureRange
from .rig import MOTION

SEEN_NUMBERS = 6
"""Observed numbers of a ball: position and velocity."""


class RigRows:
    """Views of the newest rows (N,) of arms and (N, worlds) of worlds, overwritten by each step.

    Arrays of all balls begin with the worlds of the first arm.
    """

    def __init__(
        self, arms: NDArray[Any], worlds: NDArray[Any], arm: o80.Frontend, world: o80.Frontend
    ) -> None:
        """arm, world: frontends of the first arm and world."""
        self.ball = world.actuators[JOINTS].name
        """Name of the ball's actuator."""
        self.range = PressureRange.of(arm)
        """Range of the raw pressures."""
        self.motion: FloatArray = field_view(arms, *MOTION)
        """(N, 8) angles [rad] then velocities [rad/s] of the joints"""
        self.racket: FloatArray = field_view(arms, "extended.racket_position")
        """(N, 3) [m]"""
        self.desired, self.observed = arms["desired"], arms["observed"]
        """(N, 8) raw pressures: desired, and in the muscles."""
        flat = worlds.reshape(-1)
        self.iteration: NDArray[np.int64] = flat["iteration"][:1]
        """(1,) of the first world"""
        self.balls: FloatArray = field_view(flat, "observed.balls")[:, :SEEN_NUMBERS]
        """(N * worlds, 6) position [m] and velocity [m/s]"""
        assert np.shares_memory(self.balls, worlds)
        self.records: NDArray[Any] = flat["extended"]["contacts"][:, 0]
        """(N * worlds,) contacts of each ball, in the simulator's form."""
        self.read_records: Callable[[], BallRecord] = BallRecords(self.records).read
        """Reads the records of all balls."""
        self._muscles = [actuator.name for actuator in arm.actuators]

    def gather(
        self,
        arms: o80.InlineGroup,
        worlds: o80.InlineGroup,
        bounds: tuple[Float32Array, Float32Array] | None,
    ) -> list[Float32Array]:
        """Makes C++ gather the balls' flags in each step and reset.

        bounds: least and largest observation (22,) of ball play; if given, C++ also fills the
        returned parts (N, ...) of the observation.
        """
        numbers: list[o80.Gathered] = []
        gathered: list[Float32Array] = []
        if bounds is not None:
            clips = [*zip(*(each.tolist() for each in bounds), strict=True)]
            paths = [f"{field}[{joint}]" for field in MOTION for joint in range(JOINTS)]
            paths += [f"observed.{name}" for name in self._muscles]
            offsets = [0.0] * (2 * JOINTS) + self.range.least.tolist()
            scales = [1.0] * (2 * JOINTS) + self.range.scale.tolist()
            columns = zip(paths, offsets, scales, clips[: PRESSURES.stop], strict=True)
            gathered.append(arms.gather([o80.Gathered(*each) for each in columns]).observations)
            parts = ("position", "velocity")
            paths = [f"observed.{self.ball}.{part}[{axis}]" for part in parts for axis in range(3)]
            ball = zip(paths, clips[BALL_POSITION.start : SIZE], strict=True)
            numbers = [o80.Gathered(path, clip=clip) for path, clip in ball]
        seen = worlds.gather(numbers, event_flags())
        flags = {name: seen[name] for name in seen.flag_names}
        self.read_records = BallRecords(self.records, flags).read
        return [*gathered, seen.observations] if numbers else []
