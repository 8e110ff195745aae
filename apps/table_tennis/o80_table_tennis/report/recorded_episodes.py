"""Reads the episodes of a recorded environment: rows of arm and twin, and results.

`o80.hybrid` marks environments and episodes. After each `episode_end` the environment adds a mark
`table_tennis`: the EpisodeSummary, the draws, and all observations (1 + steps, M), in base64,
because JSON numbers would take a fifth of a fast step.
"""

from __future__ import annotations

import base64
import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import o80
from o80.base.arrays import Float32Array, FloatArray

from ..settings import RigSettings, TaskSettings
from .episode_summary import EpisodeSummary

MARK = "table_tennis"  #: name of the mark


def settings_mark(rig: RigSettings, task: TaskSettings, epochs: Sequence[int]) -> dict[str, Any]:
    """Returns the options for the mark of an environment. epochs: of arm and twins."""
    told: dict[str, Any] = dict(vars(task)) | {"task": task.title}
    for name, each in told.items():
        if is_dataclass(each):
            told[name] = {field.name: getattr(each, field.name) for field in fields(each)}
    rig_values = dict(vars(rig)) | {"pacing": rig.pacing.value}
    return {"rig": rig_values, "task": told, "epochs": epochs}


def mark_episode(
    recording: o80.Recording, summary: EpisodeSummary, observed: Sequence[Float32Array], **more: Any
) -> None:
    """Marks an ended episode."""
    array = np.array(observed, "<f4")
    packed = {"shape": array.shape, "float32": base64.b64encode(array.tobytes()).decode()}
    recording.mark(MARK, **asdict(summary), **more, observations=packed)


@dataclass(frozen=True, eq=False)
class RecordedEpisode:
    """Recorded episode; the first row precedes the first step."""

    summary: EpisodeSummary
    environment: Mapping[str, Any]
    """Settings of the environment: `rig`, `task`."""
    begun: Mapping[str, Any]
    """Values of the mark at the beginning: task, number, seed, options."""
    drawn: Mapping[str, Any]
    """Draws: goal, extra balls, seeds of arm and twin."""
    arm: o80.History
    """(T,) rows of the arm"""
    twin: o80.History
    """(T,) rows of the first twin"""
    actions: NDArray[np.float32]
    """(steps, 8)"""
    rewards: FloatArray
    """(steps,)"""
    observations: NDArray[np.float32]
    """(1 + steps, M), from the reset on"""

    @property
    def period(self) -> float:
        """Interval of rows [s]."""
        return 1.0 / float(self.environment["rig"]["frequency"])

    @property
    def pacing(self) -> str:
        """Pacing of arm and twins: real time, processes or inline."""
        return str(self.environment["rig"]["pacing"])

    @property
    def times(self) -> FloatArray:
        """Times (T,) since the beginning of the episode [s]."""
        times: FloatArray = (self.arm.iteration - self.arm.iteration[0]) * self.period
        return times

    @property
    def balls(self) -> FloatArray:
        """Balls (T, B, 3), world frame [m]; the first one is played."""
        return np.asarray(self.twin.observed.balls["position"])


def recorded_episodes(path: Path | str) -> list[RecordedEpisode]:
    """Reads all ended episodes, in order.

    Raises o80.RecordingError if rows of an episode are missing, or another task marked episodes.
    """
    recording, episodes = o80.open(path), []
    marks: dict[str, Mapping[str, Any]] = {}
    rows = functools.cache(functools.partial(_rows, recording))
    for mark in recording.marks:
        marks[mark.name] = mark.values
        if mark.name == MARK:
            episodes.append(_episode(recording.path, rows, marks))
    if "episode_end" in marks and not episodes:
        raise o80.RecordingError(f"{path}: its episodes lack the mark '{MARK}'")
    return episodes


def _episode(
    path: Path, rows: Callable[[str, int], o80.History | None], marks: Mapping[str, Any]
) -> RecordedEpisode:
    place, ended, values = marks["environment"], marks["episode_end"], dict(marks[MARK])
    summary = EpisodeSummary(
        **{each.name: values.pop(each.name) for each in fields(EpisodeSummary)}
    )
    packed, steps = values.pop("observations"), slice(summary.steps)
    settings = dict(place["options"])
    arm, twin, *_ = settings.pop("epochs")

    def part(segment: str, epoch: int, first: int, last: int) -> o80.History:
        run = rows(segment, epoch)
        if run is None or len(found := run.select(since=first, until=last)) != last - first + 1:
            raise o80.RecordingError(
                f"{path} lacks rows of '{segment}' from iteration {first} to {last}: the recorder "
                "was too late. Give arm and twins a longer history"
            )
        return found

    return RecordedEpisode(
        summary=summary,
        environment=settings,
        begun=marks["episode"],
        drawn=values,
        arm=part(place["robot"], arm, summary.arm_first, summary.arm_last),
        twin=part(place["world"], twin, summary.twin_first, summary.twin_last),
        actions=np.array(ended["actions"][steps], np.float32),
        rewards=np.array(ended["rewards"][steps], np.float64),
        observations=np.frombuffer(base64.b64decode(packed["float32"]), "<f4").reshape(
            packed["shape"]
        ),
    )


def _rows(recording: o80.RecordingFile, segment: str, epoch: int) -> o80.History | None:
    """All rows of a run; None if it was not recorded."""
    return next((run.history() for run in recording[segment].epochs if run.epoch == epoch), None)
