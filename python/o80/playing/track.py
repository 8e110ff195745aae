"""Rows of one recorded segment, with the wall-clock times at which they are played."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.recording.recorded_epoch import RecordedEpoch

MAX_ROWS = 256  # most rows of a part, which one call publishes


@dataclass(frozen=True)
class Part:
    """Consecutive rows of one run of a robot."""

    run: int  #: number of the run among those that are played, from 0
    rows: NDArray[Any]  #: structured array (n,), as in the segment
    wall: NDArray[np.int64]  #: times of publication, on the wall clock [ns]

    def split(self, count: int) -> tuple["Part", "Part | None"]:
        """Returns the first `count` rows, and the rest or None."""
        if count >= len(self.rows):
            return self, None
        head = replace(self, rows=self.rows[:count], wall=self.wall[:count])
        return head, replace(self, rows=self.rows[count:], wall=self.wall[count:])


class Track:
    """The runs of one segment."""

    def __init__(self, name: str, epochs: Sequence["RecordedEpoch"]) -> None:
        self.name = name
        self.epochs = [epoch for epoch in epochs if epoch.rows]

    @property
    def time_range(self) -> tuple[int, int]:
        """Returns the wall-clock times of the first and the last row [ns]."""
        ranges = [(*epoch.time_range, epoch.wall_offset) for epoch in self.epochs]
        begins, ends = zip(*((a + offset, b + offset) for a, b, offset in ranges), strict=True)
        return min(begins), max(ends)

    def parts(self, begin: int, end: int) -> Iterator[Part]:
        """Yields the rows from `begin` to `end` [ns on the wall clock] in small parts."""
        for run, epoch in enumerate(self.epochs):
            offset = epoch.wall_offset
            for history in epoch.blocks(from_time=begin - offset, to_time=end - offset):
                for first in range(0, len(history), MAX_ROWS):
                    rows = history.rows[first : first + MAX_ROWS]
                    yield Part(run, rows, rows["time"] + offset)
