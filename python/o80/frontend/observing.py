"""How a frontend reads observations."""

from typing import TYPE_CHECKING

import numpy as np

import o80._core as _core
from o80.base.argument_checks import whole
from o80.base.errors import Error
from o80.frontend.watching import Watching
from o80.rows.history import History
from o80.rows.selection import Selection
from o80.rows.states import States


class Observing(Watching):
    """The part of o80.Frontend that reads."""

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

    def history(
        self,
        n: int | None = None,
        *,
        since: int | None = None,
        until: int | None = None,
        seconds: float | None = None,
        from_time: int | None = None,
        to_time: int | None = None,
    ) -> History:
        """Many observations at once. Without an argument: all observations in the history.

        n: the last n observations.
        seconds: observations of the last seconds before the newest one [s].
        since, until: first and last iteration, both included.
        from_time, to_time: first and last time, both included [ns], as in `Observation.time`.

        Give n, or seconds, or any of the other four. Iterations that are overwritten or not yet
        published are left out. Raises InvalidArgument.
        """
        selection = Selection.checked(n, since, until, seconds, from_time, to_time)
        first, last = selection.range(
            self.oldest, self.published, self._iteration_at, lambda: self.latest().time
        )
        return self._read(first, max(0, last + 1 - first))

    def at_time(self, time: int) -> _core.Observation:
        """The newest observation at or before a time [ns], as in `Observation.time`.

        Raises RowOverwritten if all observations in the history are later.
        """
        return self._at_time(whole(time, "time"))

    def _read(self, first: int, count: int) -> History:
        rows = np.empty(count, self._layout.row)
        _, found = self._read_rows(first, rows.view(np.uint8)) if count else (first, 0)
        return History(self._decoder, rows[:found])

    @property
    def initial_states(self) -> States:
        """The observed states of row 0, before any command.

        If row 0 was overwritten before this frontend attached: of the oldest row at that time.
        """
        if self._first is None or not len(self._first):
            raise Error(f"'{self.segment}' had no row yet when this frontend attached")
        return self._first[0].observed
