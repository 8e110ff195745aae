"""Joins rows of several segments or recordings by time."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

import o80._core as _core
from o80.base.errors import InvalidArgument
from o80.joining.row_selection import NANOSECOND, NOWHERE, before, blanked, linear, nearest
from o80.joining.sources import Timed, capture_times, named, opened, run_of, timed
from o80.rows.history import History
from o80.rows.journal import decisions

if TYPE_CHECKING:
    from o80.joining.sources import Source, Sources

HOW = {"before": before, "nearest": nearest, "linear": linear}
SEEN = "seen"
HowWord = Literal["before", "nearest", "linear"]


class AlignedHistory(History):
    """Rows of one source at T times; numbers of a missing row are NaN, or 0 if not floats."""

    __slots__ = ("age", "found")

    def __init__(
        self,
        decoder: _core.Decoder,
        rows: NDArray[Any],
        age: NDArray[np.float64],
        found: NDArray[np.bool_],
    ) -> None:
        super().__init__(decoder, rows)
        self.age = age  #: (T,) time minus capture time of the row [s]; NaN without a row
        self.found = found  #: (T,) False where no row is young enough

    def __reduce__(self) -> tuple[Any, ...]:
        return AlignedHistory, (self._decoder, self._contiguous, self.age, self.found)


class Aligned(Mapping[str, AlignedHistory]):
    """Rows of several sources at the same T times: `aligned["ball"].observed`."""

    def __init__(self, time: NDArray[np.int64], sources: Mapping[str, AlignedHistory]) -> None:
        self.time = time  #: (T,) [ns], on the clock of the rows
        self._sources = sources

    def __getitem__(self, name: str) -> AlignedHistory:
        try:
            return self._sources[name]
        except KeyError:
            there = ", ".join(self._sources)
            raise KeyError(f"there is no source {name!r}; there are: {there}") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._sources)

    def __len__(self) -> int:
        return len(self._sources)

    @property
    def complete(self) -> NDArray[np.bool_]:
        """(T,) True where every source has a row."""
        every: NDArray[np.bool_] = np.all([each.found for each in self.values()], axis=0)
        return every

    def __repr__(self) -> str:
        return f"<o80.Aligned of {', '.join(self)} at {len(self.time)} times>"


def align(
    sources: "Sources",
    *,
    by: str | None = None,
    period: float | None = None,
    at: ArrayLike | None = None,
    how: HowWord | Mapping[str, HowWord] = "before",
    max_age: float | Mapping[str, float] | None = None,
    seconds: float | None = None,
    offsets: Mapping[str, int] | None = None,
) -> Aligned:
    """Joins rows of several segments or recordings by the time of their capture.

    sources: frontends, segments of a recording, or a whole one; or a mapping from names to these,
        to runs of a recording, or to histories.
    by: name of the source whose rows give the times. "seen": each row of the first source with
        the rows of the others on which its newest batch that was pulsed with `seen` was based.
        Also works for unrelated clocks; `age` is NaN then.
    period: interval of the times, while all sources have rows [s].
    at: times (T,) [ns], on the clock of the rows. Give one of by, period and at.
    how: "before": the newest row at or before the time, as a program running then had it;
        "nearest"; or "linear": floats are interpolated between two rows (each number separately:
        not for quaternions), other numbers are those of the older row. May differ by source.
    max_age: rows further away from the time than this count as missing [s].
    seconds: only the last seconds of each source.
    offsets: added to the times of sources, for unrelated clocks [ns].

    The capture time of a row is its time; for devices it is the extended field `capture_time` [ns],
    and rows with 0 there hold nothing. Recordings of different computers, or of different boots,
    are joined on the wall clock. A recording of one run and live segments can be mixed.

    Raises InvalidArgument for wrong arguments, or clocks that cannot be compared.
    """
    if by == SEEN and SEEN not in (given := named(sources)):
        if (period, at, how, max_age, offsets) != (None, None, "before", None, None):
            raise InvalidArgument(
                "by='seen' takes no period, at, how, max_age and offsets: it joins exact rows"
            )
        return _by_seen(given, seconds)
    if sum(given is not None for given in (by, period, at)) != 1:
        raise InvalidArgument("give one of by (a source), period [s] and at (times [ns])")
    found = timed(sources, seconds=seconds, offsets=offsets)
    if not found:
        raise InvalidArgument("there is nothing to align: give at least one source")
    times = _times(found, by, period, at)
    ways = _each(found, how, "how")
    ages = _each(found, max_age, "max_age")
    return Aligned(
        times,
        {
            name: _aligned(name, source, times, ways[name], ages[name])
            for name, source in found.items()
        },
    )


def _by_seen(sources: "Mapping[str, Source]", seconds: float | None) -> Aligned:
    """Joins the rows of the first source with the rows on which its commands were based."""
    name, *others = sources
    run = run_of(sources[name])
    if not hasattr(run, "journal") or not others:
        raise InvalidArgument(
            f"by='seen' needs at least two sources. The first one must have a journal with the "
            f"rows that its commands answer: a frontend, or a run of a recording; got {run!r}"
        )
    taken = decisions(run.journal())
    rows, _ = opened(name, run, seconds)
    found = {name: _aligned(name, _counted(rows), rows.iteration, "before", None)}
    for other in others:
        history, _ = opened(other, sources[other], None)
        of_other = taken.epoch == history.epoch
        newest = np.searchsorted(taken.taken[of_other], rows.iteration, side="right") - 1
        seen = np.append(taken.iteration[of_other], -1)[newest]  # index -1: no batch yet
        picked = _aligned(other, _counted(history), seen, "before", 0.0)
        same_clock = history.schema["clock"] == rows.schema["clock"]
        captured = capture_times(picked)
        known = picked.found & same_clock & (captured is None or captured > 0)
        age = (rows.time - (picked.time if captured is None else captured)) * NANOSECOND
        picked.age[...] = np.where(known, age, np.nan)
        found[other] = picked
    if not any(found[other].found.any() for other in others):
        raise InvalidArgument(
            f"no batch of '{name}' answers a row of {' or '.join(others)} that is available: give "
            "the row when you send, as in pulse(seen=row)"
        )
    return Aligned(rows.time, found)


def _counted(history: History) -> Timed:
    """Returns the history with iterations in place of times."""
    return Timed(history, np.arange(len(history)), history.iteration)


def _each(found: Mapping[str, Timed], given: Any, name: str) -> dict[str, Any]:
    """Spreads an argument over all sources. Raises InvalidArgument for an unknown source."""
    if not isinstance(given, Mapping):
        return dict.fromkeys(found, given)
    if unknown := sorted(set(given) - set(found)):
        raise InvalidArgument(f"{name}: there is no {unknown[0]!r}; there are: {', '.join(found)}")
    usual = "before" if name == "how" else None
    return {each: given.get(each, usual) for each in found}


def _times(
    found: Mapping[str, Timed], by: str | None, period: float | None, at: ArrayLike | None
) -> NDArray[np.int64]:
    if by is not None:
        if by not in found:
            raise InvalidArgument(f"by: there is no {by!r}; there are: {', '.join(found)}")
        return found[by].times
    if at is not None:
        given = np.asarray(at)
        if given.ndim != 1 or given.dtype.kind not in "iu":
            raise InvalidArgument(
                f"at must be an array (T,) of whole nanoseconds, got {given.dtype} {given.shape}"
            )
        return given.astype(np.int64)
    assert period is not None
    step = round(period / NANOSECOND) if 0 < period < 1e9 else 0
    if step < 1:
        raise InvalidArgument(f"period must be at least 1e-9 s, got {period!r}")
    if not all(len(source.times) for source in found.values()):
        return np.empty(0, np.int64)
    first = max(int(source.times[0]) for source in found.values())
    last = min(int(source.times[-1]) for source in found.values())
    return np.arange(first, last + 1, step, dtype=np.int64)


def _aligned(
    name: str, source: Timed, times: NDArray[np.int64], how: str, max_age: float | None
) -> AlignedHistory:
    if how not in HOW:
        raise InvalidArgument(f"how must be one of {', '.join(HOW)}, got {how!r} for {name}")
    if max_age is not None and not max_age >= 0:
        raise InvalidArgument(f"max_age must be at least 0 s, got {max_age!r} for {name}")
    picked = HOW[how](source, times)
    found = picked.age != NOWHERE
    age = np.where(found, picked.age * NANOSECOND, np.nan)
    if max_age is not None:
        found &= np.abs(age) <= max_age
    rows = np.ascontiguousarray(picked.rows)
    blanked(source.history, rows, ~found)
    return AlignedHistory(source.history._decoder, rows, age, found)
