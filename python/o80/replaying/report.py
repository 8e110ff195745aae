"""The results of a replay."""

from collections.abc import Iterator
from dataclasses import dataclass

from o80.joining.difference import Difference


@dataclass(frozen=True, kw_only=True)
class RunReport:
    """Result of the replay of one run."""

    segment: str
    number: int = 0  #: index of the run in the recording
    first: int = 0  #: iteration of the first row
    rows: int = 0  #: number of compared rows, from `first` on
    difference: Difference | None = None  #: the first one; values: recorded and replayed
    gap: str = ""  #: why later rows were not replayed; empty: all were
    missing: tuple[str, ...] = ()  #: texts about rows that the recording lacks or before the start
    driver: bool = True  #: the driver was started; if not, only desired states were compared
    unused: bool = False  #: a robot or options were given, but none was started
    notes: tuple[str, ...] = ()  #: what differs between then and now
    seconds: float = 0.0  #: duration of the replay [s]
    recorded_seconds: float = 0.0  #: time span of the compared rows, on the clock of the run [s]

    @property
    def name(self) -> str:
        """Name of the segment, followed by the number of the run if that is not 0."""
        return self.segment if self.number == 0 else f"{self.segment}/{self.number}"

    @property
    def identical(self) -> bool:
        """True if every row of the run was compared and none differs."""
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
    """Results of a replay, one for each run of the recording."""

    runs: tuple[RunReport, ...]

    @property
    def identical(self) -> bool:
        """True if every row of every run was compared and none differs."""
        return bool(self.runs) and all(run.identical for run in self.runs)

    @property
    def difference(self) -> Difference | None:
        """The difference of the first run that has one; None if all are identical."""
        return next((run.difference for run in self.runs if run.difference), None)

    def __iter__(self) -> Iterator[RunReport]:
        return iter(self.runs)

    def __str__(self) -> str:
        return "\n".join(map(str, self.runs))
