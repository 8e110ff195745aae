"""Many observations at once."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self, TypedDict, Unpack, overload

import numpy as np
from numpy.typing import NDArray

import o80._core as _core
from o80.base.argument_checks import whole, whole_or_none
from o80.base.errors import InvalidArgument, RowOverwritten
from o80.rows.layout import MASKS, Layout, with_padding
from o80.rows.record import Record, States

if TYPE_CHECKING:
    import pandas

    from o80.rows.columns import Column

LONGEST = 2**62  # duration [ns], 146 years
_HEAD = ("iteration", "time", "lateness", "overruns", "skipped", "fresh", "halted", "starvations")
_ENDS = 5  # rows of each end of a history that a notebook shows
_COLUMNS = 16  # most numbers of a row that a notebook shows


class Range(TypedDict, total=False):
    """The keywords of `Frontend.history`."""

    since: int | None
    until: int | None
    seconds: float | None
    from_time: int | None
    to_time: int | None


@dataclass(frozen=True)
class Selection:
    """Selects observations by count, by the last seconds, or by iterations and times."""

    n: int | None
    since: int | None
    until: int | None
    duration: int | None  #: time before the newest observation [ns]
    from_time: int | None  #: [ns]
    to_time: int | None  #: [ns]

    @classmethod
    def checked(
        cls,
        n: int | None,
        since: int | None = None,
        until: int | None = None,
        seconds: float | None = None,
        from_time: int | None = None,
        to_time: int | None = None,
    ) -> Self:
        """Makes a selection from the arguments of a call. Raises InvalidArgument for wrong ones."""
        ends = since, until, from_time, to_time
        if (n is not None) + (seconds is not None) + any(end is not None for end in ends) > 1:
            raise InvalidArgument(
                "give either n, or seconds, or any of since, until, from_time and to_time"
            )
        return cls(
            n=whole_or_none(n, "n, the number of observations,", 0),
            since=whole_or_none(since, "since"),
            until=whole_or_none(until, "until"),
            duration=None if seconds is None else _nanoseconds(seconds),
            from_time=_moment(from_time, "from_time"),
            to_time=_moment(to_time, "to_time"),
        )

    def range(
        self,
        oldest: int,
        newest: int,
        iteration_at: Callable[[int], int],
        newest_time: Callable[[], int],
    ) -> tuple[int, int]:
        """Returns first and last iteration between oldest and newest; empty if first is above last.

        iteration_at: returns the newest iteration at or before a time, `oldest - 1` if there is
            none.
        """
        first, last = oldest, newest
        if newest < oldest:
            return first, last
        if self.n is not None:
            first = max(first, newest + 1 - self.n)
        if self.duration is not None:
            first = max(first, iteration_at(newest_time() - self.duration) + 1)
        if self.since is not None:
            first = max(first, self.since)
        if self.until is not None:
            last = min(last, self.until)
        if self.from_time is not None:
            first = max(first, iteration_at(self.from_time - 1) + 1)
        if self.to_time is not None:
            last = min(last, iteration_at(self.to_time))
        return first, last

    def place(self, iterations: NDArray[np.int64], times: NDArray[np.int64]) -> slice:
        """Returns the positions of the selected ones of observations, given in rising order."""
        count = len(iterations)
        if self.n is not None or not count:
            return slice(max(0, count - (self.n or 0)), count)
        oldest, newest = int(iterations[0]), int(iterations[-1])

        def iteration_at(time: int) -> int:
            at = int(np.searchsorted(times, time, side="right")) - 1
            return int(iterations[at]) if at >= 0 else oldest - 1

        first, last = self.range(oldest, newest, iteration_at, lambda: int(times[-1]))
        if (first, last) == (oldest, newest):
            return slice(0, count)
        begin = int(np.searchsorted(iterations, first))
        return slice(begin, max(begin, int(np.searchsorted(iterations, last, side="right"))))


class History:
    """Consecutive observations, oldest first: arrays with a first dimension (T,).

    All arrays are views of one copy, `rows`, which does not change. A history may hold fewer rows
    than requested, but every row is complete. It can be pickled, and passed to `numpy.save`,
    `numpy.savez` and h5py, which store `rows`; for pandas there is `to_frame()`.
    """

    __slots__ = ("_decoder", "_layout", "rows")

    def __init__(self, decoder: _core.Decoder, rows: NDArray[Any]) -> None:
        """Raises InvalidArgument if the rows have another layout than described."""
        decoder.layout.check(rows)
        self._decoder = decoder
        self._layout: Layout = decoder.layout
        self.rows = rows  #: structured array (T,): whole rows, as in the segment

    @classmethod
    def _joined(cls, decoder: _core.Decoder, parts: Iterable["History"]) -> "History":
        """Joins consecutive histories."""
        nothing = np.empty(0, decoder.layout.row)
        each = [with_padding(rows) for rows in (nothing, *(part.rows for part in parts))]
        return cls(decoder, np.concatenate(each).view(nothing.dtype))

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def schema(self) -> dict[str, Any]:
        """The description of the robot."""
        return self._layout.schema

    @overload
    def __getitem__(self, index: int) -> _core.Observation: ...
    @overload
    def __getitem__(self, index: slice) -> "History": ...
    @overload
    def __getitem__(self, index: str) -> NDArray[Any]: ...
    def __getitem__(self, index: int | slice | str) -> "_core.Observation | History | NDArray[Any]":
        """The observation at a position: 0 is the oldest, -1 the newest; a slice is a History.

        A path gives the numbers there: `history["observed.joint1.position"]`, (T,), as a column of
        `to_frame()`; that of several numbers, such as "observed.joints", (T, n).

        To find observations by iteration or time use `at_iteration`, `at_time`, `select`.
        """
        if isinstance(index, str):
            from o80.rows.columns import columns_at  # late: most processes never need it

            values = [values_of(self, each) for each in self._layout.columns_at(index, columns_at)]
            return values[0] if len(values) == 1 else np.stack(values, axis=1)
        if isinstance(index, slice):
            if index.step is not None and index.step < 0:
                raise InvalidArgument(
                    f"a history begins with its oldest row: the step of a slice must be positive, "
                    f"got {index.step}"
                )
            return History(self._decoder, self.rows[index])
        return _core.Observation(self._decoder, self.rows[index].tobytes())

    def __iter__(self) -> Iterator[_core.Observation]:
        return (self[i] for i in range(len(self)))

    def at_iteration(self, iteration: int) -> _core.Observation:
        """Returns the observation of an iteration. Raises RowOverwritten if it is not in here."""
        iteration = whole(iteration, "iteration")
        place = int(np.searchsorted(self.iteration, iteration))
        if place == len(self) or self.iteration[place] != iteration:
            raise RowOverwritten(f"row {iteration} is not in this history, {self._extent}")
        return self[place]

    def at_time(self, time: int) -> _core.Observation:
        """Returns the newest observation at or before a time [ns].

        Raises RowOverwritten if all observations of this history are later.
        """
        time = whole(time, "time")
        place = int(np.searchsorted(self.time, time, side="right")) - 1
        if place < 0:
            raise RowOverwritten(
                f"no row of {time} ns or before is in this history, {self._extent}"
            )
        return self[place]

    def select(self, n: int | None = None, **selection: Unpack[Range]) -> "History":
        """Returns a part of this history, without a copy; arguments as for `Frontend.history`."""
        return self[Selection.checked(n, **selection).place(self.iteration, self.time)]

    @property
    def _extent(self) -> str:
        if not len(self):
            return "which is empty"
        iterations, times = self.iteration, self.time
        return (
            f"which holds rows {iterations[0]} to {iterations[-1]}, of {times[0]} to {times[-1]} ns"
        )

    def to_frame(self) -> "pandas.DataFrame":
        """Converts to a pandas data frame: a row for each observation, a column for each number.

        The index is the iteration. Columns are named after part, actuator and field, such as
        "observed.elbow", "desired.joints[0].position" or "extended.force[2]"; times are in
        nanoseconds. Enumerations are categories.

        Raises MissingExtra without pandas.
        """
        from o80.base.extras import needed
        from o80.rows.columns import columns_of

        pandas = needed("pandas", "pandas", "a data frame")
        data: dict[str, Any] = columns_in(self)
        index = pandas.Index(data.pop("iteration"), name="iteration")
        for column in columns_of(self.schema):
            if column.labels is not None:
                data[column.name] = _categories(pandas, data[column.name], column.labels)
        return pandas.DataFrame(data, index=index)

    @property
    def iteration(self) -> NDArray[np.int64]:
        """Iterations: (T,), rising; by 1, unless rows are missing or a slice has left some out."""
        return self._part("iteration")

    @property
    def time(self) -> NDArray[np.int64]:
        """Times [ns]: (T,)."""
        return self._part("time")

    @property
    def lateness(self) -> NDArray[np.int64]:
        """How long after its due moment each iteration began [ns]: (T,)."""
        return self._part("lateness")

    @property
    def overruns(self) -> NDArray[np.uint32]:
        """Number of iterations so far that were late: (T,)."""
        return self._part("overruns")

    @property
    def skipped(self) -> NDArray[np.uint32]:
        """Number of periods so far that were skipped: (T,)."""
        return self._part("skipped")

    @property
    def fresh(self) -> NDArray[np.bool_]:
        """True in rows of a fresh start: (T,)."""
        return self._part("fresh").astype(np.bool_)

    @property
    def halted(self) -> NDArray[np.bool_]:
        """True in rows with a halt in force: (T,)."""
        return self._part("halted").astype(np.bool_)

    @property
    def starvations(self) -> NDArray[np.int64]:
        """Number of iterations so far in which a plan of chunks began to be starved: (T,)."""
        return self._part("starvations")

    def _part(self, name: str) -> NDArray[Any]:
        part: NDArray[Any] = self.rows[name]
        return part

    @property
    def desired(self) -> States:
        """The desired states: (T, actuators), or a record of groups."""
        return self._layout.many(self.rows, "desired")

    @property
    def observed(self) -> States:
        """The observed states: (T, actuators), or a record of groups."""
        return self._layout.many(self.rows, "observed")

    @property
    def extended(self) -> Record:
        """Further sensor values: a record with an array (T, ...) for each field."""
        return self._layout.many_extras(self.rows)

    @property
    def active(self) -> NDArray[np.bool_]:
        """True where a command or braking gave the desired state: (T, actuators)."""
        return self._layout.many_masks(self.rows, "active")

    @property
    def clamped(self) -> NDArray[np.bool_]:
        """True where the limits changed the desired state: (T, actuators)."""
        return self._layout.many_masks(self.rows, "clamped")

    @property
    def braking(self) -> NDArray[np.bool_]:
        """True where the actuator comes to rest without a command: (T, actuators)."""
        return self._layout.many_masks(self.rows, "braking")

    @property
    def starved(self) -> NDArray[np.bool_]:
        """True where a plan of chunks has no row left and is not closed: (T, actuators)."""
        return self._layout.many_masks(self.rows, "starved")

    @property
    def off_plan(self) -> NDArray[np.float32]:
        """Distance of the desired states from those that commands request, where limits act.

        (T, actuators), the largest of the numbers of each actuator, in their units.
        """
        if not self._layout.actuators:
            return np.zeros((len(self), 0), np.float32)
        return self._part("off_plan")

    def flat(self, dtype: Any = None) -> NDArray[Any]:
        """All observed numbers, then all extended ones: (T, numbers), float32 by default."""
        return self._layout.many_flat(self.rows, dtype)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        """The rows, for NumPy and h5py."""
        return np.array(self.rows, dtype=dtype, copy=copy)

    @property
    def epoch(self) -> int:
        """Number of the run that published the rows; 0: not known."""
        return self._decoder.epoch

    def __reduce__(self) -> tuple[Any, ...]:
        return History, (self._decoder, self._contiguous)

    @property
    def _contiguous(self) -> NDArray[Any]:
        """Returns the rows without gaps between them, which a slice may leave."""
        return np.ascontiguousarray(with_padding(self.rows)).view(self.rows.dtype)

    def _repr_html_(self) -> str:
        """Makes a table for a notebook: the first and the last rows."""
        from o80.base.screen import html  # late: most processes show no table
        from o80.rows.columns import columns_of

        columns = [*columns_of(self.schema)]
        shown = columns[:_COLUMNS]
        more = (
            f"; {len(columns) - len(shown)} more numbers a row" if len(columns) > _COLUMNS else ""
        )
        count = len(self)
        places = [*range(count)]
        if count > 2 * _ENDS:
            places = [*range(_ENDS), *range(count - _ENDS, count)]
        rows: list[list[Any]] = []
        for place in places:
            row = self.rows[place : place + 1]
            rows.append([row["iteration"][0], row["time"][0]])
            for column in shown:
                value = row.getfield(column.dtype, column.offset)[0].item()
                words = [word for word, number in (column.labels or {}).items() if number == value]
                rows[-1].append(words[0] if words else f"{value:.6g}")
        if len(places) < count:
            rows.insert(_ENDS, ["…"] * (2 + len(shown)))
        heads = ["iteration", "time [ns]", *(column.name for column in shown)]
        return html(heads, rows, f"{count} observations{more}")

    def __repr__(self) -> str:
        if not len(self):
            return "<o80.History of no observation>"
        first, last = int(self.iteration[0]), int(self.iteration[-1])
        return f"<o80.History of {len(self)} observations, {first} to {last}>"


def values_of(history: History, column: "Column") -> NDArray[Any]:
    """Copies the numbers of a column to a contiguous array (T,)."""
    values: NDArray[Any] = history.rows.getfield(column.dtype, column.offset).copy()
    return values


def numbers_of(history: History, columns: Sequence["Column"]) -> NDArray[np.float64]:
    """Copies the numbers of columns to an array (T, columns)."""
    numbers = np.empty((len(history), len(columns)))
    for i, column in enumerate(columns):
        numbers[:, i] = values_of(history, column)
    return numbers


def columns_in(history: History) -> dict[str, NDArray[Any]]:
    """Returns all numbers of all rows by name, as `History.to_frame`; enumerations as numbers."""
    from o80.rows.columns import columns_of  # late: most processes that attach never need it

    columns = {name: np.ascontiguousarray(getattr(history, name)) for name in _HEAD}
    for column in columns_of(history.schema):
        columns[column.name] = values_of(history, column)
    names = [actuator["name"] for actuator in history.schema["actuators"]]
    for part in (*MASKS, "off_plan"):
        mask = getattr(history, part)
        columns.update({f"{part}.{name}": mask[:, i].copy() for i, name in enumerate(names)})
    return columns


def _categories(pandas: Any, values: NDArray[Any], labels: dict[str, int]) -> Any:
    """Converts an enumeration's numbers to categories; unknown numbers become missing values."""
    codes = np.full(len(values), -1)
    for code, value in enumerate(labels.values()):
        codes[values == value] = code
    return pandas.Categorical.from_codes(codes, list(labels))


def _moment(time: int | None, name: str) -> int | None:
    """Checks a time [ns], and clamps one that no clock reaches."""
    checked = whole_or_none(time, name)
    return None if checked is None else min(max(checked, -LONGEST), LONGEST)


def _nanoseconds(seconds: float) -> int:
    if isinstance(seconds, (bool, str)) or not math.isfinite(seconds) or seconds < 0:
        raise InvalidArgument(f"seconds must be a finite number of at least 0, got {seconds!r}")
    return round(min(seconds * 1e9, LONGEST))
