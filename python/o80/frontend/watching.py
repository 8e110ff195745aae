"""How a frontend tells whether the loop of its backend keeps up."""

from __future__ import annotations

from typing import TYPE_CHECKING

import o80._core as _core
from o80.frontend.describing import Describing

if TYPE_CHECKING:
    from o80.rows.journal import JournalEntry


class Watching(Describing):
    """The part of o80.Frontend that watches the loop of the backend."""

    def journal(self, since: int | None = None) -> list[JournalEntry]:
        """Decisions of the backend, oldest first: who sent what, when it was taken, how it ended.

        since: number of the first entry to return (None: the oldest that there is). To follow a
            backend, keep an `o80.Journal`, which reads each entry once.

        Also for a read-only frontend, and after the end of the backend. Raises Closed.
        """
        from o80.rows.journal import Journal  # late: most processes that attach never ask

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
