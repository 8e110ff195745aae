"""Puts histories of several runs on common time axes."""

from collections.abc import Mapping
from typing import NamedTuple

from o80.rows.history import History

APART = 10_000_000_000  # runs further apart have axes of their own [ns]


class Placed(NamedTuple):
    """A history, and wall-clock time less row time [ns]; None: not known."""

    history: History
    wall_offset: int | None


def origins(runs: Mapping[str, Placed]) -> tuple[dict[str, int], int]:
    """The row time [ns] that is 0 on the axis of each run, and how many axes there are.

    Runs that overlap on the wall clock, or follow each other within ten seconds, share an axis,
    which begins with their first row. A run of another day begins at 0 by itself, and so does one
    whose wall-clock time is not known.
    """
    known: list[tuple[int, int, str]] = []
    found: dict[str, int] = {}
    for name, (history, offset) in runs.items():
        if not len(history):
            found[name] = 0
        elif offset is None:
            found[name] = int(history.time[0])
        else:
            known.append((int(history.time[0]) + offset, int(history.time[-1]) + offset, name))
    axes = sum(1 for run in runs.values() if run.wall_offset is None and len(run.history))
    zero = end = None
    for first, last, name in sorted(known):
        if zero is None or end is None or first > end + APART:
            zero, end = first, last
            axes += 1
        end = max(end, last)
        offset = runs[name].wall_offset
        assert offset is not None
        found[name] = zero - offset
    return found, axes
