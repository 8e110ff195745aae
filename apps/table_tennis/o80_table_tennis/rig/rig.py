"""The arm and its twins: started or attached to, and gone when left."""

from __future__ import annotations

import os
from contextlib import ExitStack
from itertools import count
from types import TracebackType
from typing import Any, Self

import o80

from ..settings import ITERATIONS, Pacing, RigSettings
from ..world.scene import MODEL
from .arm import Arm
from .ball_records import ball_options
from .twin import TIMEOUT, Twin

NUMBERS = count(1)
JOINT_NAMES = "joint_1,joint_2,joint_3,joint_4"


def unused_name(robot: str) -> str:
    """Of a segment that no rig of any process has."""
    return f"{robot}-{os.getpid()}-{next(NUMBERS)}"


class Rig:
    """One arm and the twins that mirror it, in one of three ways of pacing.

    Move nothing but through it while it is open; leaving it ends all that it started.
    """

    def __init__(self, settings: RigSettings | None = None) -> None:
        self.settings = settings or RigSettings()
        self._stack = ExitStack()
        try:
            self.arm = Arm(self._open_arm())
            self.twins = [Twin(self._open_twin(twin)) for twin in range(self.settings.twins)]
        except BaseException:
            self._stack.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Ends all that was started; may be called twice."""
        self._stack.close()

    def step_twins(self) -> None:
        """All twins mirror the arm's last rows, at the same time."""
        if len(self.twins) == 1:
            self.twins[0].step(self.arm.motion)
            return
        for twin in self.twins:
            twin.mirror(self.arm.motion)
        self.burst_twins(ITERATIONS)

    def burst_twins(self, iterations: int) -> None:
        """All twins run at the same time."""
        rows = o80.burst({twin.frontend: iterations for twin in self.twins}, timeout=TIMEOUT)
        for twin in self.twins:
            twin.see(rows[twin.frontend])

    def _open_arm(self) -> o80.Frontend:
        settings = self.settings
        if settings.attach:
            assert settings.arm_segment is not None
            return self._stack.enter_context(o80.Frontend(settings.arm_segment))
        options = {
            "muscle": settings.muscle,
            "ranges": settings.ranges,
            "start_noise": settings.start_noise,
            "period": settings.period,
        }
        return self._open("pam", settings.arm_segment, settings.pacing.real_time, options)

    def _open_twin(self, twin: int) -> o80.Frontend:
        options = {
            "model": str(MODEL),
            "joints": JOINT_NAMES,
            "timestep": self.settings.period,
            **ball_options(self.settings.balls_of(twin)),
        }
        return self._open("mujoco", None, False, options)

    def _open(
        self, robot: str, segment: str | None, real_time: bool, options: dict[str, Any]
    ) -> o80.Frontend:
        """Starts a robot in the way of this rig, and opens a frontend to it."""
        settings = self.settings
        library = o80.robots.load(robot)
        common: dict[str, Any] = {
            "segment": segment or unused_name(robot),
            "frequency": settings.frequency,
            "history": settings.history,
        }
        if settings.pacing is Pacing.INLINE:
            return self._stack.enter_context(library.inline(**common, **options))
        process = self._stack.enter_context(
            library.start(bursting=not real_time, **common, **options)
        )
        return self._stack.enter_context(process.frontend())
