"""Many observations at once."""

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

import o80._core as _core
from o80.base.argument_checks import whole
from o80.base.errors import InvalidArgument, RowOverwritten
from o80.rows.layout import with_padding
from o80.rows.record import Record
from o80.rows.selection import Selection
from o80.rows.states import States
from o80.rows.tables import history_html

if TYPE_CHECKING:
    import pandas


class History:
    """Consecutive observations, oldest first: arrays with a first dimension (T,).

    Its arrays are views of one copy, `rows`, which does not change. It may hold fewer rows than
    requested, but every row is complete. It can be pickled, and given to `numpy.save`,
    `numpy.savez` and h5py, which store `rows`; for pandas there is `to_frame()`.
    """

    __slots__ = ("_decoder", "_layout", "rows")

    def __init__(self, decoder: _core.Decoder, rows: NDArray[Any]) -> None:
        """Raises InvalidArgument if the rows do not lie as the description says."""
        decoder.layout.check(rows)
        self._decoder = decoder
        self._layout = decoder.layout
        self.rows = rows  #: structured array (T,): whole rows, as in the segment

    @classmethod
    def _joined(cls, decoder: _core.Decoder, parts: Iterable["History"]) -> "History":
        """One history of consecutive ones."""
        nothing = np.empty(0, decoder.layout.row)
        each = [with_padding(rows) for rows in (nothing, *(part.rows for part in parts))]
        return cls(decoder, np.concatenate(each).view(nothing.dtype))

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def schema(self) -> dict[str, Any]:
        """The description of the robot."""
        schema: dict[str, Any] = self._layout.schema
        return schema

    @overload
    def __getitem__(self, index: int) -> _core.Observation: ...
    @overload
    def __getitem__(self, index: slice) -> "History": ...
    def __getitem__(self, index: int | slice) -> "_core.Observation | History":
        """The observation at a position: 0 is the oldest, -1 the newest; a slice is a History.

        To find observations by iteration or time use `at_iteration`, `at_time`, `select`.
        """
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
        """The observation of an iteration. Raises RowOverwritten if it is not in this history."""
        iteration = whole(iteration, "iteration")
        place = int(np.searchsorted(self.iteration, iteration))
        if place == len(self) or self.iteration[place] != iteration:
            raise RowOverwritten(f"row {iteration} is not in this history, {self._extent}")
        return self[place]

    def at_time(self, time: int) -> _core.Observation:
        """The newest observation at or before a time [ns].

        Raises RowOverwritten if all observations of this history are later.
        """
        time = whole(time, "time")
        place = self._place_of(time)
        if place < 0:
            raise RowOverwritten(
                f"no row of {time} ns or before is in this history, {self._extent}"
            )
        return self[place]

    def select(
        self,
        n: int | None = None,
        *,
        since: int | None = None,
        until: int | None = None,
        seconds: float | None = None,
        from_time: int | None = None,
        to_time: int | None = None,
    ) -> "History":
        """A part of this history, without a copy. The arguments are those of `Frontend.history`."""
        selection = Selection.checked(n, since, until, seconds, from_time, to_time)
        if not len(self):
            return self
        if selection.n is not None:
            return self[max(0, len(self) - selection.n) :]
        first, last = selection.range(
            int(self.iteration[0]),
            int(self.iteration[-1]),
            self._iteration_at,
            lambda: int(self.time[-1]),
        )
        begin = int(np.searchsorted(self.iteration, first))
        end = int(np.searchsorted(self.iteration, last, side="right"))
        return self[begin : max(begin, end)]

    def _place_of(self, time: int) -> int:
        """Position of the newest observation at or before a time; -1 if all are later."""
        return int(np.searchsorted(self.time, time, side="right")) - 1

    def _iteration_at(self, time: int) -> int:
        """Iteration of that observation; one before the first if all are later."""
        place = self._place_of(time)
        return int(self.iteration[place]) if place >= 0 else int(self.iteration[0]) - 1

    @property
    def _extent(self) -> str:
        if not len(self):
            return "which is empty"
        iterations, times = self.iteration, self.time
        return (
            f"which holds rows {iterations[0]} to {iterations[-1]}, of {times[0]} to {times[-1]} ns"
        )

    def to_frame(self) -> "pandas.DataFrame":
        """A pandas data frame: a row for each observation, a column for each number.

        Its index is the iteration. Columns are named after part, actuator and field, such as
        "observed.elbow", "desired.joints[0].position" or "extended.force[2]"; times are in
        nanoseconds. Enumerations are categories.

        Raises MissingExtra without pandas.
        """
        from o80.rows.frames import frame_of

        return frame_of(self)

    @property
    def iteration(self) -> NDArray[np.int64]:
        """Iterations: (T,), each one more than the one before."""
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
        fresh: NDArray[np.bool_] = self._part("fresh") != 0
        return fresh

    @property
    def halted(self) -> NDArray[np.bool_]:
        """True in rows with a halt in force: (T,)."""
        halted: NDArray[np.bool_] = self._part("halted") != 0
        return halted

    def _part(self, name: str) -> NDArray[Any]:
        part: NDArray[Any] = self.rows[name]
        return part

    @property
    def desired(self) -> States:
        """The desired states: (T, actuators), or a record of groups."""
        states: States = self._layout.many(self.rows, "desired")
        return states

    @property
    def observed(self) -> States:
        """The observed states: (T, actuators), or a record of groups."""
        states: States = self._layout.many(self.rows, "observed")
        return states

    @property
    def extended(self) -> Record:
        """Further sensor values: a record with an array (T, ...) for each field."""
        extended: Record = self._layout.many_extras(self.rows)
        return extended

    @property
    def active(self) -> NDArray[np.bool_]:
        """True where a command or braking gave the desired state: (T, actuators)."""
        mask: NDArray[np.bool_] = self._layout.many_masks(self.rows, "active")
        return mask

    @property
    def clamped(self) -> NDArray[np.bool_]:
        """True where the limits changed the desired state: (T, actuators)."""
        mask: NDArray[np.bool_] = self._layout.many_masks(self.rows, "clamped")
        return mask

    @property
    def braking(self) -> NDArray[np.bool_]:
        """True where the actuator comes to rest without a command: (T, actuators)."""
        mask: NDArray[np.bool_] = self._layout.many_masks(self.rows, "braking")
        return mask

    def flat(self, dtype: Any = None) -> NDArray[Any]:
        """All observed numbers, then all extended ones: (T, numbers), float32 by default."""
        numbers: NDArray[Any] = self._layout.many_flat(self.rows, dtype)
        return numbers

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        """The rows, for NumPy and h5py."""
        return np.array(self.rows, dtype=dtype, copy=copy)

    def __reduce__(self) -> tuple[Any, ...]:
        return History, (self._decoder, self._contiguous)

    @property
    def _contiguous(self) -> NDArray[Any]:
        """The rows without rows between them, which a slice may leave out."""
        return np.ascontiguousarray(with_padding(self.rows)).view(self.rows.dtype)

    def _repr_html_(self) -> str:
        """As a table of a notebook: the first and the last rows."""
        return history_html(self)

    def __repr__(self) -> str:
        if not len(self):
            return "<o80.History of no observation>"
        first, last = int(self.iteration[0]), int(self.iteration[-1])
        return f"<o80.History of {len(self)} observations, {first} to {last}>"
