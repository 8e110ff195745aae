"""Source of a page: one run of a robot, live or recorded."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

from o80._core import Observation
from o80.base.errors import Error
from o80.rows.history import History
from o80.rows.plans import Planned
from o80.view.world import Drawn, drawn

NANOSECONDS = 1e9


class NothingToShow(Error):  # noqa: N818
    """There is no row yet, or no longer."""


class Source(ABC):
    """Rows by time. Times are in seconds since `zero`, the time of the first row that was there."""

    name: str  #: of the segment
    label: str  #: for the list of a page
    live: bool
    key: str = ""  #: changes when another run takes the name
    zero: int = 0  #: [ns]
    #: False: it may come from a stranger, and files that its model names are not read
    trusted: bool = False
    _drawn: tuple[str, Drawn | None] = "", None

    @property
    def alive(self) -> bool:
        """Whether its backend runs."""
        return False

    @property
    @abstractmethod
    def schema(self) -> dict[str, Any]:
        """The description of the robot. Raises NothingToShow."""

    @property
    @abstractmethod
    def model(self) -> str:
        """Text of the model (MJCF) that draws the robot; empty: none."""

    @property
    def drawn(self) -> Drawn | None:
        """The model with what moves it; None: there is none."""
        key, found = self._drawn
        if key != self.key or not key:
            try:
                found = drawn(self.schema, self.model, trusted=self.trusted)
            except Error:
                return None
            self._drawn = self.key, found
        return found

    @abstractmethod
    def refresh(self) -> None:
        """Attaches to a newer run, if there is one."""

    @abstractmethod
    def extent(self) -> tuple[int, int]:
        """Times of the first and last row [ns]. Raises NothingToShow."""

    @abstractmethod
    def row(self, time: int | None) -> Observation:
        """The newest row at or before a time [ns], else the first; None: the newest row.

        Raises NothingToShow.
        """

    @abstractmethod
    def rows(self, begin: int, end: int) -> History:
        """Rows from one time to another [ns]. Raises NothingToShow."""

    @abstractmethod
    def marks(self) -> Sequence[tuple[str, int]]:
        """Text and iteration of the marks of this run, in their order."""

    def plans(self, rows: History) -> dict[str, list[Planned]]:
        """Plans of chunks that began among these rows, by panel, as far as they are known."""
        return {}

    @abstractmethod
    def time_with(self, other: "Source", row: Observation) -> int | None:
        """The time [ns] of this source when another published a row; None: they never ran together.

        Raises NothingToShow.
        """

    @abstractmethod
    def state(self) -> dict[str, Any]:
        """Entry of this source in the segment list: state, rate, overruns, age of the last row."""

    def seconds(self, time: int) -> float:
        """A time [ns] as the page shows it [s]."""
        return (time - self.zero) / NANOSECONDS

    def nanoseconds(self, seconds: float) -> int:
        """The reverse."""
        return self.zero + round(seconds * NANOSECONDS)
