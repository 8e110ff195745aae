"""The results of a replay."""

from collections.abc import Iterator
from dataclasses import dataclass

from o80.joining.difference import Difference


@dataclass(frozen=True, kw_only=True)
class RunReport:
    """The replay of one run of a robot."""

    segment: str
    number: int = 0  #: of the run in the recording, from 0
    first: int = 0  #: iteration of the first row
    rows: int = 0  #: number of rows that were compared, from this one on
    difference: Difference | None = None  #: the first one; values: recorded and replayed
    gap: str = ""  #: why later rows were not replayed; empty: all were
    missing: tuple[str, ...] = ()  #: of the run in the recording, or before where it began
    driver: bool = True  #: it was started; else desired states were compared, and no readings
    unused: bool = False  #: a robot or options were given, but none was started
    notes: tuple[str, ...] = ()  #: what differs between then and now
    seconds: float = 0.0  #: that the replay took
    recorded_seconds: float = 0.0  #: that the compared rows span, on the clock of the run

    @property
    def name(self) -> str:
        """The segment, and the number of the run if it is not the first."""
        return self.segment if self.number == 0 else f"{self.segment}/{self.number}"

    @property
    def identical(self) -> bool:
        """Every row of the run was compared, and none differs."""
        return self.difference is None and not self.gap and not self.missing

    def __str__(self) -> str:
        if self.difference is not None:
            return f"{self.name}: {self.difference}"
        if not self.rows:
            return f"{self.name}: not replayed: {self.gap}"
        text = f"{self.name}: {self.rows} row{'' if self.rows == 1 else 's'}, "
        text += "identical" if self.driver else "no driver was started: desired states identical"
        if self.gap:
            text += f" up to row {self.first + self.rows - 1}; then {self.gap}"
        return "; ".join([text, *self.missing])


@dataclass(frozen=True)
class ReplayReport:
    """The replay of all runs of a recording."""

    runs: tuple[RunReport, ...]

    @property
    def identical(self) -> bool:
        """Every row of every run was compared, and none differs."""
        return bool(self.runs) and all(run.identical for run in self.runs)

    @property
    def difference(self) -> Difference | None:
        """The first difference of the first run that has one."""
        return next((run.difference for run in self.runs if run.difference), None)

    def __iter__(self) -> Iterator[RunReport]:
        return iter(self.runs)

    def __str__(self) -> str:
        return "\n".join(map(str, self.runs))
