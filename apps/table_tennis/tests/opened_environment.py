"""Opens environments for tests."""

from pathlib import Path
from typing import Any

import numpy as np

from o80_table_tennis.environment import TableTennisEnvironment
from o80_table_tennis.settings import Pacing, RigSettings, TaskSettings
from o80_table_tennis.task.actions import COARSE
from o80_table_tennis.world.arm import MUSCLES

STILL = np.zeros(MUSCLES, dtype=np.float32)
PUSH = np.array([1, -1, 0, 0, 0, 0, 0, 0], dtype=np.float32)
ALL_MODES = list(Pacing)
PATIENT = TaskSettings(factor=COARSE, max_late=1_000_000)  # independent of the machine's speed
WAITING = 10.0  # [s]


def opened(
    pacing: Pacing = Pacing.INLINE,
    *,
    task: TaskSettings | None = None,
    record: Path | None = None,
    **rig: Any,
) -> TableTennisEnvironment:
    settings = RigSettings(pacing=pacing, **rig)
    return TableTennisEnvironment(rig=settings, task=task or PATIENT, record=record)


def played_out(environment: TableTennisEnvironment, action: np.ndarray = STILL) -> list[Any]:
    """Plays all steps of an episode."""
    steps: list[Any] = []
    while not steps or not (steps[-1][2] or steps[-1][3]):
        steps.append(environment.step(action))
    return steps
