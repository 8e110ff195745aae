"""Gymnasium environments of hybrid tasks, and their recordings."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.utils.seeding import np_random

from o80.base.errors import InvalidArgument
from o80.base.finite import json_text
from o80.frontend.frontend import Frontend
from o80.hybrid.single import Single
from o80.learning.environment import Environment
from o80.learning.infos import Info
from o80.recording.recording import Recording


class HybridEnvironment(Environment):
    """Environment of one robot and its world.

    With `record` all rows of robot and world are recorded, and episodes are marked:

    | mark | when | values |
    |---|---|---|
    | `environment` | when it is made | segments of robot and world, options |
    | `episode` | before the first step | number, task, seed, state of the generator, options |
    | `episode_end` | after the last step | actions, rewards, rows, how it ended |
    | `episode_dropped` | in a reset before the end | |

    Data sets are made from these marks, see docs/recording/exporting.md.
    """

    task: Any
    """The HybridTask of this environment."""
    recording: Recording | None = None
    """The recording, to which a program may add its own marks."""

    def __init__(
        self,
        task: Any,
        *,
        render_mode: str | None = None,
        record: str | Path | None = None,
        options: Mapping[str, Any] | None = None,
    ) -> None:
        """record: a file; options: options of the task, for a mark. Raises RecordingError."""
        super().__init__(task, render_mode=render_mode)
        self._marks = None if record is None else _Marks(task, record, options or {})
        self.recording = None if self._marks is None else self._marks.recording

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, Info]:
        """Begins an episode. Raises CopyFailed if the robot is halted and may not be resumed."""
        if self._marks is not None:
            self._marks.drop()
        if seed is not None:
            self._np_random, self._np_random_seed = np_random(seed)
        state = json_text(self.np_random.bit_generator.state)
        observed = super().reset(seed=seed, options=options)
        if self._marks is not None:
            self._marks.begin(self._np_random_seed, state, options or {})
        return observed

    def step(self, action: Any) -> tuple[Any, float, bool, bool, Info]:
        """Executes an action."""
        if self._marks is not None:
            self._marks.mark_begin()
        stepped = super().step(action)
        if self._marks is not None:
            self._marks.step(action, *stepped[1:])
        return stepped

    def close(self) -> None:
        """Finishes the recording and closes the task; may be called twice."""
        if self.recording is not None:
            self.recording.close()
        super().close()


class _Marks:
    """Records a robot and its world, and marks the episodes."""

    def __init__(self, task: Any, path: str | Path, options: Mapping[str, Any]) -> None:
        if not isinstance(task.engine, Single):
            raise InvalidArgument("record is for one robot with frontends: leave out threads")
        self._engine = task.engine
        self._members: list[Frontend] = task.engine.frontends
        self._task, self._number = task.title or type(task).__name__, 0
        self._margin = 2 * task.engine.iterations
        self._actions: list[Any] = []
        self._rewards: list[float] = []
        self._runs, self._begins = False, dict[str, Any]()
        self.recording = Recording(path, self._members, proceed=Path(path).exists())
        names = [each.segment for each in self._members]
        self.recording.mark("environment", robot=names[0], world=names[1], options=_plain(options))
        self._flush()

    def drop(self) -> None:
        """Marks an unfinished episode as dropped."""
        if self._runs:
            self.recording.mark("episode_dropped")
        self._runs, self._begins = False, {}

    def begin(self, seed: int | None, state: str, options: Mapping[str, Any]) -> None:
        """Prepares the mark of an episode; state: of the generator before the reset."""
        values = {"task": self._task, "seed": seed, "generator": state, "options": _plain(options)}
        self._begins = {"number": self._number, **values}
        self._number += 1

    def mark_begin(self) -> None:
        """Marks the begin before the first step: rows before it do not belong to the episode."""
        if self._begins:
            self.recording.mark("episode", **self._begins)
            self._actions, self._rewards, self._runs, self._begins = [], [], True, {}

    def step(
        self, action: Any, reward: float, terminated: bool, truncated: bool, info: Info
    ) -> None:
        """Notes a step; marks the end of an episode."""
        self._actions.append(np.array(action).tolist())
        self._rewards.append(reward)
        rows = zip(self._members, self._flushed, strict=True)
        if any(each.oldest > flushed - self._margin for each, flushed in rows):
            self._flush()  # before rows are overwritten
        if not (terminated or truncated):
            return
        self._flush()  # a marked episode must have its rows
        self.recording.mark(
            "episode_end",
            terminated=terminated,
            truncated=truncated and not terminated,
            actions=self._actions,
            rewards=self._rewards,
            rows=self._engine.span,
            info=_plain(info),
        )
        self._runs = False

    def _flush(self) -> None:
        newest = [member.published for member in self._members]
        self.recording.flush()
        self._flushed = newest


def _plain(value: Any) -> Any:
    """Converts a value for JSON: a number that is not finite to None, other types to text."""
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(each) for each in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return _plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, (bool, int, str)) else str(value)
