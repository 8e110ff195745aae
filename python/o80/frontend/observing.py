"""How a frontend reads what the backend published."""

from typing import TYPE_CHECKING

import numpy as np

from o80 import _core
from o80.checked import whole
from o80.errors import Error
from o80.frontend.describing import Describing
from o80.history import History
from o80.selection import Selection
from o80.states import States


class Observing(Describing):
    """The part of o80.Frontend that reads."""

    _first: History | None

    if TYPE_CHECKING:

        @property
        def published(self) -> int:
            """The iteration of the newest observation."""

        @property
        def oldest(self) -> int:
            """The iteration of the oldest observation still there."""

        def latest(self) -> _core.Observation:
            """The newest observation."""

        def wait_for(self, iteration: int, timeout: float | None = None) -> _core.Observation:
            """The observation of an iteration, as soon as it is there (a past one: at once).

            Raises RowOverwritten if the history no longer holds it, TimeoutError after `timeout`
            [s], BackendGone.
            """

        def wait_for_next(self, timeout: float | None = None) -> _core.Observation:
            """The observation after the one that this call returned before.

            The first call waits for the next one. If the reader fell behind, `missed` of the
            observation says how many were overwritten unread. The position belongs to this
            frontend: threads that all need every row use a stream each.

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
        """Many observations at once. Without an argument: all that are still there.

        n: the last n.
        seconds: those of the last seconds before the newest one [s].
        since, until: those of these iterations, both included.
        from_time, to_time: those of these times, both included [ns], as in `Observation.time`.

        Give n, or seconds, or any of the other four. What is no longer there, or not yet, is left
        out. Raises InvalidArgument.
        """
        selection = Selection.checked(n, since, until, seconds, from_time, to_time)
        first, last = selection.range(
            self.oldest, self.published, self._iteration_at, lambda: self.latest().time
        )
        return self._read(first, max(0, last + 1 - first))

    def at_time(self, time: int) -> _core.Observation:
        """The newest observation at or before a time [ns], as in `Observation.time`.

        Raises RowOverwritten if all that are still there are later.
        """
        return self._at_time(whole(time, "time"))

    def _read(self, first: int, count: int) -> History:
        rows = np.empty(count, self._layout.row)
        _, found = self._read_rows(first, rows.view(np.uint8)) if count else (first, 0)
        return History(self._decoder, rows[:found])

    @property
    def initial_states(self) -> States:
        """The observed states of row 0, before anything was asked.

        If that row was overwritten before this frontend attached: of the oldest row it found.
        """
        if self._first is None or not len(self._first):
            raise Error(f"'{self.segment}' had no row yet when this frontend attached")
        return self._first[0].observed
