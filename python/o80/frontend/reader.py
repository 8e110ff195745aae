"""Reader: the part of o80.Frontend that reads observations and describes the robot.

Modules that most processes never need are imported when they are first used: each would make the
first attach up to 3 ms slower.
"""

from typing import TYPE_CHECKING, Any, Unpack, overload

import numpy as np
from numpy.typing import NDArray

import o80._core as _core
from o80.base.argument_checks import whole
from o80.base.cached import cached
from o80.base.errors import Error
from o80.base.signatures import explains
from o80.rows.history import History, Range, Selection
from o80.rows.layout import Layout

_MOST = 4096  # native entries of a journal converted at a time
_NEVER = 2**62  # larger than the number of any entry

if TYPE_CHECKING:
    from o80.base.words import LifeWord
    from o80.rows.actuators import Actuator
    from o80.rows.journal import JournalEntry
    from o80.rows.provenance import Provenance
    from o80.rows.record import States


@explains
class Reader(_core.Frontend):
    """The part of o80.Frontend that describes the robot, watches the loop and reads rows."""

    # ------------------------------------------------------------------ the robot and its backend

    _description: _core.Description
    _layout: Layout
    _decoder: _core.Decoder

    if TYPE_CHECKING:

        @property
        def segment(self) -> str:
            """The name of the segment."""

        @property
        def epoch(self) -> int:
            """The number of this run of the backend; another run of the same name has another."""

        @property
        def bursting(self) -> bool:
            """True if the backend runs only the iterations that frontends request."""

        @property
        def life(self) -> LifeWord:
            """starting, running, stopped, failed, superseded or killed."""

        @property
        def closed(self) -> bool:
            """True if this frontend was closed."""

    @property
    def alive(self) -> bool:
        """True while the backend runs or starts."""
        return self.life in ("starting", "running")

    @property
    def schema(self) -> dict[str, Any]:
        """The description of the robot."""
        return self._layout.schema

    @property
    def provenance(self) -> "Provenance":
        """How the backend was started: options, versions, and the offset to the wall clock."""
        from o80.rows.provenance import Provenance

        return Provenance.from_fields(_core.provenance_fields(self))

    @property
    def robot(self) -> str:
        """The name of the robot."""
        name: str = self.schema["robot"]
        return name

    @property
    def model(self) -> str:
        """The model (MJCF) that draws the robot; empty if its driver names none."""
        return self._layout.model

    @cached
    def actuators(self) -> "list[Actuator]":
        """The actuators: index, name, unit, limits."""
        from o80.rows.actuators import Actuators, actuators_of

        return Actuators(actuators_of(self.schema), self.schema)

    @property
    def requests(self) -> dict[str, str]:
        """The requests that the driver serves, each with its help."""
        return {request["name"]: request["help"] for request in self.schema["requests"]}

    @property
    def enums(self) -> dict[str, Any]:
        """An IntEnum for each enumerated field, by its name."""
        return self._layout.enums

    @property
    def period(self) -> float:
        """Duration of an iteration [s]."""
        nanoseconds: int = self.schema["period"]
        return nanoseconds * 1e-9

    @property
    def frequency(self) -> float:
        """Iterations a second [1/s]."""
        nanoseconds: int = self.schema["period"]
        return 1e9 / nanoseconds

    # ------------------------------------------------------------------ the loop of the backend

    def journal(self, since: int | None = None) -> "list[JournalEntry]":
        """Decisions of the backend, oldest first: who sent what, when it was taken, how it ended.

        since: number of the first entry to return (None: the oldest that there is). To follow a
            backend, keep an `o80.Journal`, which reads each entry once.

        Works for read-only frontends and after the end of the backend. Raises Closed after `close`.
        """
        return Journal(self, since).read()

    @property
    def rate_reached(self) -> float | None:
        """Iterations a second over the last second of rows [1/s].

        0.0 if rows have stopped coming. None in bursting, whose time is simulated, and before there
        are two rows.
        """
        return _core.loop_state(self).rate

    @property
    def overruns(self) -> int:
        """Late iterations since the start."""
        return _core.loop_state(self).overruns

    @property
    def missed_ticks(self) -> int:
        """Skipped periods, or missed ticks of the robot, since the start."""
        return _core.loop_state(self).skipped

    @property
    def row_age(self) -> float | None:
        """Time since the newest row [s]; None in bursting, and before row 0."""
        return _core.loop_state(self).row_age

    @property
    def played(self) -> bool:
        """True if the rows come from a recording (`o80 play`): commands are refused."""
        return _core.loop_state(self).played

    @property
    def slow_verb(self) -> tuple[str, float] | None:
        """The function of the driver that has not returned, and for how long [s]; or None.

        Calls shorter than some 20 ms are not noticed. In bursting, None means that the backend
        waits for a burst.
        """
        return _core.loop_state(self).slow_verb

    @property
    def trouble(self) -> str:
        """Missing rows with the cause, or overruns with the rate reached; empty if all is well."""
        return _core.loop_state(self).trouble

    # ------------------------------------------------------------------ observations

    _first: History | None

    if TYPE_CHECKING:

        @property
        def published(self) -> int:
            """The iteration of the newest observation."""

        @property
        def oldest(self) -> int:
            """The iteration of the oldest observation in the history."""

        def latest(self) -> _core.Observation:
            """The newest observation."""

        def wait_for(self, iteration: int, timeout: float | None = None) -> _core.Observation:
            """Waits until an iteration is published and returns its observation.

            Raises RowOverwritten if the history no longer holds it, TimeoutError after `timeout`
            [s], BackendGone.
            """

        def wait_for_next(self, timeout: float | None = None) -> _core.Observation:
            """The observation after the one that this call returned before.

            The first call waits for the next one. If the reader was too slow, `missed` of the
            observation is the number of observations that were overwritten before they were read.
            The position belongs to this frontend: threads that each need every row need a stream
            each.

            Raises TimeoutError after `timeout` [s], BackendGone.
            """

        def stream(self, since: int | None = None, timeout: float | None = None) -> _core.Stream:
            """Iterates over every observation, in order, from `since` (None: the next one).

            timeout: longest wait for one of them [s].
            """

    @overload
    def history(
        self, n: int | None = None, *, fields: None = None, **selection: Unpack[Range]
    ) -> History: ...
    @overload
    def history(
        self, n: int | None = None, *, fields: str, **selection: Unpack[Range]
    ) -> NDArray[Any]: ...
    @overload
    def history(
        self,
        n: int | None = None,
        *,
        fields: list[str] | tuple[str, ...],
        **selection: Unpack[Range],
    ) -> tuple[NDArray[Any], ...]: ...
    def history(
        self,
        n: int | None = None,
        *,
        since: int | None = None,
        until: int | None = None,
        seconds: float | None = None,
        from_time: int | None = None,
        to_time: int | None = None,
        fields: str | list[str] | tuple[str, ...] | None = None,
    ) -> History | NDArray[Any] | tuple[NDArray[Any], ...]:
        """Returns many observations at once; without an argument all in the history.

        n: the last n observations.
        seconds: observations of the last seconds before the newest one [s].
        since, until: first and last iteration, both included.
        from_time, to_time: first and last time, both included [ns], as in `Observation.time`.
        fields: paths, as in `history["observed.elbow"]`. Only these numbers are copied: the result
            is the array of a path, or a tuple with an array for each of several paths.

        Give n, or seconds, or any of the other four. Iterations that are overwritten or not yet
        published are left out. Raises InvalidArgument.
        """
        selection = Selection.checked(n, since, until, seconds, from_time, to_time)
        first, last = selection.range(
            self.oldest, self.published, self._iteration_at, lambda: self.latest().time
        )
        if fields is None:
            return self._read(first, max(0, last + 1 - first))
        arrays = self._read_fields(first, max(0, last + 1 - first), fields)
        return arrays[0] if isinstance(fields, str) else arrays

    def at_time(self, time: int) -> _core.Observation:
        """Returns the newest observation at or before a time [ns], as in `Observation.time`.

        Raises RowOverwritten if all observations in the history are later.
        """
        return self._at_time(whole(time, "time"))

    def _read(self, first: int, count: int) -> History:
        rows = np.empty(count, self._layout.row)
        _, found = self._read_rows(first, rows.view(np.uint8)) if count else (first, 0)
        return History(self._decoder, rows[:found])

    def _read_fields(
        self, first: int, count: int, fields: str | list[str] | tuple[str, ...]
    ) -> tuple[NDArray[Any], ...]:
        from o80.rows.columns import packing_at  # late: most processes never need it

        packing = packing_at(self._layout, fields)
        rows = np.empty(count, packing.dtype)
        if not rows.nbytes:
            return packing.arrays(rows)
        where = rows.view(np.uint8), packing.parts, rows.itemsize
        _, found = self._read_rows(first, *where)
        return packing.arrays(rows[:found])

    @property
    def initial_states(self) -> "States":
        """The observed states of row 0, before any command.

        If row 0 was overwritten before this frontend attached: those of the oldest row then.
        """
        if self._first is None or not len(self._first):
            raise Error(f"'{self.segment}' had no row yet when this frontend attached")
        return self._first[0].observed


class Journal:
    """Reads the journal of a frontend's backend, in order and without waiting.

    since: number of the first entry to read (None: the oldest that there is).
    new: only entries written from now on.

    For one thread. Works with read-only frontends, and with backends that have ended.
    """

    def __init__(self, frontend: Reader, since: int | None = None, *, new: bool = False) -> None:
        from o80.rows.journal import EntryDecoder  # late: most processes never need it

        self._core = _core.Journal(frontend)
        self._decoder = EntryDecoder(frontend._layout.schema)
        if new:
            self._core.seek_end()
        elif since is not None:
            self._core.seek(min(whole(since, "since", 0), _NEVER))

    @property
    def exists(self) -> bool:
        """False if the backend was started without a journal."""
        return self._core.exists

    def read(self) -> "list[JournalEntry]":
        """Returns the entries since the last call."""
        entries = self._core.read(_MOST)
        found = [self._decoder.entry(entry) for entry in entries]
        while len(entries) == _MOST:
            entries = self._core.read(_MOST)
            found += [self._decoder.entry(entry) for entry in entries]
        return found
