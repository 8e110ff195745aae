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
    """Provides rows by time. Seconds count from `zero`, the time of the first row found."""

    name: str  #: name of the segment
    label: str  #: label in the list of a page
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
        """The description of the robot. Raises NothingToShow if there is no row."""

    @property
    @abstractmethod
    def model(self) -> str:
        """Text of the model (MJCF) that draws the robot; empty: none."""

    @property
    def drawn(self) -> Drawn | None:
        """The model, with the values that move it; None: no model."""
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
        """Returns times of the first and last row [ns]. Raises NothingToShow if there is no row."""

    @abstractmethod
    def row(self, time: int | None) -> Observation:
        """Returns the newest row at or before a time [ns], else the first; None: the newest row.

        Raises NothingToShow if there is no row.
        """

    @abstractmethod
    def rows(self, begin: int, end: int) -> History:
        """Returns rows from one time to another [ns]. Raises NothingToShow if there is no row."""

    @abstractmethod
    def marks(self) -> Sequence[tuple[str, int]]:
        """Returns text and iteration of the marks of this run, in order."""

    def plans(self, rows: History) -> dict[str, list[Planned]]:
        """Returns the known plans of chunks that began among these rows, by panel."""
        return {}

    @abstractmethod
    def time_with(self, other: "Source", row: Observation) -> int | None:
        """Converts the time of another source's row to this source's time [ns]; None: unrelated.

        Raises NothingToShow if there is no row.
        """

    @abstractmethod
    def state(self) -> dict[str, Any]:
        """Makes this source's entry in the segment list: state, rate, overruns, age of last row."""

    def seconds(self, time: int) -> float:
        """Converts a time [ns] to seconds of the page [s]."""
        return (time - self.zero) / NANOSECONDS

    def nanoseconds(self, seconds: float) -> int:
        """Converts seconds of the page [s] to a time [ns]."""
        return self.zero + round(seconds * NANOSECONDS)
