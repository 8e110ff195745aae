"""Reads the episodes that an environment recorded: rows of arm and twin, and how they ended."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import o80
from o80.base.arrays import FloatArray

from .episode_recorder import ENVIRONMENT, EPISODE, EPISODE_END, unpacked
from .episode_summary import EpisodeSummary


@dataclass(frozen=True, eq=False)
class RecordedEpisode:
    """A recorded episode. Its rows begin with the one before the first step."""

    summary: EpisodeSummary
    environment: Mapping[str, Any]
    """Values of the mark of its environment: segments, settings."""
    begun: Mapping[str, Any]
    """Values of the mark at its beginning: task, seeds, balls, goal."""
    arm: o80.History
    """(T,) rows of the arm"""
    twin: o80.History
    """(T,) rows of the first twin"""
    actions: NDArray[np.float32]
    """(steps, 8)"""
    rewards: FloatArray
    """(steps,)"""
    observations: NDArray[np.float32]
    """(1 + steps, M): the first one is that of the reset"""

    @property
    def period(self) -> float:
        """Between two rows [s]."""
        return float(self.environment["period"])

    @property
    def pacing(self) -> str:
        """How arm and twins ran: real time, processes or inline."""
        return str(self.environment["rig"]["pacing"])

    @property
    def times(self) -> FloatArray:
        """(T,) since the beginning of the episode [s]."""
        times: FloatArray = (self.arm.iteration - self.arm.iteration[0]) * self.period
        return times

    @property
    def balls(self) -> FloatArray:
        """(T, B, 3), world frame [m]; the first one is played."""
        return np.asarray(self.twin.observed.balls["position"])


def recorded_episodes(path: Path | str) -> list[RecordedEpisode]:
    """All episodes that came to an end, in their order.

    Raises o80.RecordingError if rows of an episode are missing.
    """
    return list(_Reader(o80.open(path)).episodes())


class _Reader:
    """Follows the marks of a recording."""

    def __init__(self, recording: o80.RecordingFile) -> None:
        self._recording = recording
        self._environment: Mapping[str, Any] = {}
        self._begun: Mapping[str, Any] = {}
        self._arm: o80.History | None = None
        self._twin: o80.History | None = None

    def episodes(self) -> Iterator[RecordedEpisode]:
        for mark in self._recording.marks:
            if mark.name == ENVIRONMENT:
                self._environment, self._arm, self._twin = mark.values, None, None
            elif mark.name == EPISODE:
                self._begun = mark.values
            elif mark.name == EPISODE_END:
                yield self._episode(mark.values)

    def _episode(self, ended: Mapping[str, Any]) -> RecordedEpisode:
        if self._arm is None or self._twin is None:
            self._arm = self._rows_of(self._environment["arm"])
            self._twin = self._rows_of(self._environment["twins"][0])
        summary = EpisodeSummary(**{name: ended[name] for name in self._summarised(ended)})
        return RecordedEpisode(
            summary=summary,
            environment=self._environment,
            begun=self._begun,
            arm=self._part(self._arm, summary.arm_first, summary.arm_last),
            twin=self._part(self._twin, summary.twin_first, summary.twin_last),
            actions=np.array(ended["actions"], np.float32),
            rewards=np.array(ended["rewards"], np.float64),
            observations=unpacked(ended["observations"]),
        )

    def _summarised(self, ended: Mapping[str, Any]) -> list[str]:
        """Names of what a summary holds."""
        names = [each.name for each in fields(EpisodeSummary)]
        if missing := [name for name in names if name not in ended]:
            raise o80.RecordingError(
                f"{self._recording.path} was recorded by another version of this package: its "
                f"marks lack {', '.join(missing)}. Read its rows with o80.open"
            )
        return names

    def _rows_of(self, place: Mapping[str, Any]) -> o80.History:
        """All rows of one run of a robot."""
        for epoch in self._recording[place["segment"]].epochs:
            if epoch.epoch == place["epoch"]:
                return epoch.history()
        raise o80.RecordingError(
            f"{self._recording.path} has marks of segment '{place['segment']}', but no rows of it"
        )

    def _part(self, history: o80.History, first: int, last: int) -> o80.History:
        rows = history.select(since=first, until=last)
        if len(rows) != last - first + 1:
            raise o80.RecordingError(
                f"{self._recording.path} lacks rows of the episode from iteration {first} to "
                f"{last}: the recorder was too late. Give arm and twins a longer history"
            )
        return rows
