"""Records arm and worlds of an environment, and marks its episodes in the recording.

The rows come from the segments. Only the environment knows where an episode begins, which ball it
plays and what its steps were worth: this is what the marks hold.

| mark | when | values |
|---|---|---|
| `environment` | when it is made | segments and epochs of arm and worlds, settings |
| `episode` | with its first step | number, task, seeds, balls, goal |
| `episode_end` | after its last step | `EpisodeSummary`; all actions, rewards and observations |

They follow the rules of docs/recording.md for episodes, so `o80 export` makes data sets of them.
Of n steps: actions (n, 8), with chunks (n, chunk_size, 8), rewards (n,), observations (1 + n, M),
from that of the reset on. The observations are packed (see `packed`): as texts in JSON they would
take a fifth of a fast step.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

import o80
from o80.base.arrays import Float32Array

from ..settings import RigSettings, TaskSettings
from ..world.timing import ITERATIONS
from .episode_summary import EpisodeSummary

ENVIRONMENT, EPISODE, EPISODE_END = "environment", "episode", "episode_end"
"""Names of the marks."""
MARGIN = 2 * ITERATIONS
"""A step flushes when fewer rows than this are left before unread ones are overwritten."""


class EpisodeRecorder:
    """Writes a recording beside an environment; see the module.

    A file that exists is continued. Every row is recorded, from the oldest that the segments still
    hold: the recorder's thread reads them, and a step waits for it only where rows would be lost.

    Raises o80.RecordingError, now or when the disk is full.
    """

    def __init__(
        self, path: Path, frontends: Sequence[o80.Frontend], rig: RigSettings, task: TaskSettings
    ) -> None:
        """frontends: of the arm, then of its worlds."""
        self._frontends = frontends
        self._recording = o80.Recording(path, self._frontends, proceed=path.exists())
        self._task = task.task if isinstance(task.task, str) else type(task.task).__name__
        self._flushed = [-1] * len(self._frontends)
        """Iteration of each segment at the last flush."""
        try:
            arm, *twins = (
                {"segment": each.segment, "epoch": each.epoch} for each in self._frontends
            )
            self._recording.mark(
                ENVIRONMENT,
                arm=arm,
                twins=twins,
                period=rig.period,
                rig=_plain(rig),
                task=_plain(task),
            )
            self.flush()
        except BaseException:
            self.close()
            raise

    def begin(self, observation: Float32Array, **values: Any) -> None:
        """An episode begins; `observation` (M,) is that of its reset. The mark gets `values`."""
        self._actions: list[Float32Array] = []
        self._rewards: list[float] = []
        self._observations = [observation]
        self._recording.mark(EPISODE, **values, task=self._task)

    def step(self, action: Float32Array, reward: float, observation: Float32Array) -> None:
        """A step was taken: action (8,), and what came of it, with the observation (M,)."""
        self._actions.append(np.array(action, np.float32))
        self._rewards.append(reward)
        self._observations.append(observation.copy())
        for frontend, flushed in zip(self._frontends, self._flushed, strict=True):
            if frontend.oldest > flushed - MARGIN:
                self.flush()
                break

    def end(self, summary: EpisodeSummary) -> None:
        """The episode has ended."""
        self.flush()  # before the mark: an episode that is marked has its rows
        self._recording.mark(
            EPISODE_END,
            **asdict(summary),
            truncated=not summary.terminated,
            actions=self._actions,
            rewards=self._rewards,
            observations=packed(self._observations),
        )

    def flush(self) -> None:
        """Returns when every row published so far is in the file."""
        newest = [frontend.published for frontend in self._frontends]
        self._recording.flush()
        self._flushed = newest

    def close(self) -> None:
        """Finishes the file; may be called twice."""
        self._recording.close()


def packed(rows: Sequence[Float32Array]) -> dict[str, Any]:
    """Arrays (M,) of equal length, for a mark: their shape, and in base64 their numbers."""
    array = np.array(rows, "<f4")
    return {"shape": array.shape, "float32": base64.b64encode(array.tobytes()).decode()}


def unpacked(value: Mapping[str, Any]) -> Float32Array:
    """Array that `packed` has packed."""
    numbers = np.frombuffer(base64.b64decode(value["float32"]), "<f4")
    return numbers.reshape(value["shape"])


def _plain(value: Any) -> Any:
    """Settings as what JSON can hold: an object of the user's own becomes its text."""
    if hasattr(value, "__dataclass_fields__"):
        return {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, (list, tuple)):
        return [_plain(each) for each in value]
    if value is None or isinstance(value, (bool, int, float, str, np.generic, np.ndarray)):
        return value
    return repr(value)
