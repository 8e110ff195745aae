"""Finds the episodes of a recording by the marks of the recording program.

The rules are in docs/recording/exporting.md#export-for-learning.
"""

import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from o80.base.argument_checks import iterations
from o80.base.cached import cached
from o80.base.errors import InvalidArgument
from o80.datasets.asked import Asked
from o80.rows.columns import Column, chosen, columns_of_part
from o80.rows.history import History, numbers_of

if TYPE_CHECKING:
    import o80._core as _core
    from o80.recording.marks import Mark
    from o80.recording.reader import RecordingFile
    from o80.recording.recorded_epoch import RecordedEpoch

BEGIN, END = "episode", "episode_end"
"""Names of the marks before and after an episode. The first may name a task: "episode: push"."""
DROPPED = "_dropped"  #: suffix of the first name: a mark that ends an episode and drops it


@dataclass(frozen=True)
class Episode:
    """An episode of T steps."""

    rows: History  #: T + 1 rows: before each step, and after the last step
    rewards: NDArray[np.float64]  #: (T,)
    #: (T,) iteration of the row on which each action was based, by `pulse(seen=row)` (for a row of
    #: another robot: the newest row of this robot at that time); -1: not known.
    seen: NDArray[np.int64]
    #: (T,) decision latency of each action, from that row to its first iteration [s]; NaN: unknown
    delays: NDArray[np.float64]
    terminated: bool  #: the episode ended by itself; if not, it was truncated
    task: str
    values: Mapping[str, Any]  #: values of the mark at its begin
    sensors: Sequence[Column]  #: the columns of `extended`
    _run: "_Run" = field(repr=False)

    def __len__(self) -> int:
        return len(self.rewards)

    @cached
    def observed(self) -> NDArray[np.float64]:
        """The observed states: (T + 1, numbers)."""
        return numbers_of(self.rows, columns_of_part(self.rows.schema, "observed"))

    @cached
    def extended(self) -> NDArray[np.float64]:
        """Further sensor values: (T + 1, numbers)."""
        return numbers_of(self.rows, self.sensors)

    @cached
    def observations(self) -> NDArray[np.float64]:
        """The observed states, then the sensor values: (T + 1, numbers)."""
        return np.concatenate([self.observed, self.extended], axis=1)

    @cached
    def actions(self) -> NDArray[np.float64]:
        """Actions of all steps, the desired states: (T, numbers)."""
        return numbers_of(self.rows[1:], columns_of_part(self.rows.schema, "desired"))

    def asked(self, columns: Sequence[Column]) -> NDArray[np.float64]:
        """Returns the commands' targets (T, columns) at the ends of the steps, for columns of
        desired numbers; NaN where there was no target.
        """
        return self._run.asked.at(self.rows.iteration[1:], columns)


@dataclass(frozen=True)
class Episodes:
    """Episodes of one robot, and the reasons for episodes that could not be used."""

    segment: str
    robot: str
    frequency: float  #: steps a second [1/s]
    names: Mapping[str, Sequence[str]]  #: names of the numbers in desired, observed and extended
    all: Sequence[Episode]
    left_out: Sequence[str]  #: why an episode, or the end of one, is missing: a sentence for each


def episodes_of(
    recording: "RecordingFile",
    segment: str | None = None,
    *,
    every: float = 1,
    begin: str = BEGIN,
    end: str = END,
    fields: Sequence[str] = (),
) -> Episodes:
    """Finds the episodes of one segment of a recording.

    segment: may be left out if only one segment has actuators.
    every: length of a step in iterations, or as a float in seconds.
    begin, end: names of the marks before and after an episode.
    fields: names of sensor values such as "measured.velocity" (empty: all except clock times and
        values that a twin lacks).
    Raises InvalidArgument for an unknown segment or field, or wrong rewards.
    """
    robot = recording[_segment(recording, segment)]
    _sensors(robot.name, robot.schema, fields)  # refuses fields that it lacks
    usual = (begin, end) == (BEGIN, END)
    left_out = _misspelt(recording.marks, robot.name) if usual else []
    by_run = zip(map(_Run, robot.epochs), recording.marks_by_run(robot.name), strict=True)
    spans = [(run, span) for run, marks in by_run for span in _spans(marks, begin, end)]
    found: list[Episode] = []
    form: tuple[int, Mapping[str, Sequence[str]]] | None = None  # length of a step [ns], names
    for number, (run, span) in enumerate(spans):
        where = f"episode {number} (mark at row {span.marks[0].rows[robot.name]})"
        if not span.dropped:
            _refuse_wrong_rewards(span, robot.name)
        period = run.epoch.schema["period"]
        step = iterations(every, "every", period * 1e-9, 1)
        try:
            episode = _episode(span, where, run, robot.name, step, fields, left_out)
            own = period * step, _names(run.epoch.schema, episode.sensors)
            form = form or own
            if own != form:
                raise InvalidArgument(
                    "its run has another frequency or other numbers than that of the first "
                    "episode: cut the recording between them (o80 cut), and export each part"
                )
            found.append(episode)
        except InvalidArgument as error:
            left_out.append(f"{where}: {error}")
    if form is None:
        why = f": {left_out[0]}" if left_out else f": it has no mark '{begin}'"
        raise InvalidArgument(
            f"{recording.path} holds no episode of '{robot.name}'{why}. While it is recorded, "
            f"mark the beginning of each: `o80 mark {robot.name} {begin}` in a terminal, a key of "
            f'`o80 teleop`, or recording.mark("{begin}") in a program'
        )
    return Episodes(
        segment=robot.name,
        robot=found[0].rows.schema["robot"],
        frequency=1e9 / form[0],
        names=form[1],
        all=found,
        left_out=left_out,
    )


# ---------------------------------------------------------------------------- marks


@dataclass(frozen=True)
class _Span:
    marks: Sequence["Mark"]  #: the mark at its begin, and marks in it
    until: "Mark | None"  #: the mark at which it ends
    ending: "Mark | None"  #: `until`, if it is an end mark
    dropped: bool  #: whether the program dropped it


def _spans(marks: Sequence["Mark"], begin: str, end: str) -> Iterator[_Span]:
    """Yields the spans between the marks of a run that begin and end episodes."""
    open_at: list[Mark] = []
    for mark in marks:
        begins = mark.name == begin or mark.name.startswith(f"{begin}: ")
        if open_at and (begins or mark.name in (end, begin + DROPPED)):
            dropped = mark.name == begin + DROPPED
            yield _Span(open_at, mark, None if begins else mark, dropped)
            open_at = []
        if begins:
            open_at = [mark]
        elif open_at:
            open_at.append(mark)
    if open_at:
        yield _Span(open_at, None, None, False)


def _misspelt(marks: Sequence["Mark"], segment: str) -> list[str]:
    """Returns sentences about marks with misspelt names of episode marks."""
    return [
        f"the mark '{mark.name}' at row {mark.rows[segment]}, which neither begins nor ends an "
        f"episode: marks are '{BEGIN}', '{BEGIN}: TASK', '{END}' and '{BEGIN}{DROPPED}'"
        for mark in marks
        if segment in mark.rows
        and mark.name.lower().startswith(BEGIN)
        and mark.name not in (BEGIN, END, BEGIN + DROPPED)
        and not mark.name.startswith(f"{BEGIN}: ")
    ]


class _Run:
    """A run of the robot; its rows and its journal are read once."""

    def __init__(self, epoch: "RecordedEpoch") -> None:
        self.epoch = epoch

    @cached
    def rows(self) -> History:
        return self.epoch.history()

    @cached
    def orders(self) -> "_Orders":
        return _Orders.of(self.epoch.native_journal())

    @cached
    def asked(self) -> Asked:
        return Asked(self.epoch.native_journal(), self.epoch.schema)


def _episode(
    span: _Span,
    where: str,
    run: _Run,
    segment: str,
    every: int,
    fields: Sequence[str],
    left_out: list[str],
) -> Episode:
    """Makes an episode. Raises InvalidArgument if it was dropped, lacks rows or has no step."""
    if span.dropped:
        raise InvalidArgument("it was discarded")
    mark, ending = span.marks[0], span.ending
    first, last = mark.rows[segment], None if span.until is None else span.until.rows[segment]
    rows = run.rows.select(since=first, until=last)
    if not len(rows) or rows.iteration[0] != first:
        raise InvalidArgument("its first row is not in the recording")
    fresh = np.flatnonzero(rows.fresh[1:])
    is_cut = False
    if len(fresh):
        rows = rows[: 1 + int(fresh[0])]
        began = int(rows.iteration[-1]) + 1
        if ending is not None and last is not None and last > began:
            is_cut = True
            left_out.append(
                f"{where}: it ends at row {began}, where the robot made a fresh start (a resume, "
                f"a reset, a request); the rows up to its mark '{ending.name}' at row {last} "
                f"are left out"
            )
    if len(rows) != rows.iteration[-1] - first + 1:
        raise InvalidArgument("it has a gap")
    steps = (len(rows) - 1) // every
    if steps < 1:
        raise InvalidArgument("it has no step")
    rows = rows[: steps * every + 1 : every]
    seen, delays = run.orders.decided(rows.iteration[1:], run.rows)
    task = str(mark.values.get("task", "")) or mark.name.partition(": ")[2]
    return Episode(
        rows=rows,
        rewards=_rewards(span, segment, every, steps),
        seen=seen,
        delays=delays,
        terminated=ending is not None and not is_cut and not ending.values.get("truncated", False),
        task=task or run.epoch.schema["robot"],
        values=mark.values,
        sensors=_sensors(segment, run.epoch.schema, fields),
        _run=run,
    )


@dataclass(frozen=True)
class _Orders:
    """The batches with commands that were taken, and the fresh starts, oldest first."""

    taken: NDArray[np.int64]  #: (N,) the iteration
    since: NDArray[np.int64]  #: (N,) row on which the batch was based; -1: not known, or none

    @classmethod
    def of(cls, entries: "Iterable[_core.JournalEntry]") -> "_Orders":
        found = [
            (
                each.iteration,
                -1 if each.seen is None or each.seen.since is None else each.seen.since,
            )
            for each in entries
            if each.kind == "fresh_start"
            or (each.kind == "taken" and any(one.kind == "command" for one in each.records))
        ]
        orders = np.array(found, np.int64).reshape(-1, 2)
        return cls(orders[:, 0], orders[:, 1])

    def decided(
        self, iterations: NDArray[np.int64], run: History
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Returns `seen` and `delays` of the newest batch taken at each of these iterations."""
        newest = np.searchsorted(self.taken, iterations, side="right") - 1
        seen: NDArray[np.int64] = np.append(self.since, -1)[newest]  # index -1: no batch yet
        taken = np.append(self.taken, 0)[newest]
        known = seen >= 0
        delays = np.where(known, (taken - seen) * run.schema["period"] * 1e-9, np.nan)
        if known.any() and not run.schema["bursting"]:  # by the clock: periods may be skipped
            rows = run.select(since=int(seen[known].min()), until=int(iterations[-1]))
            delays[known] = (_times(rows, taken) - _times(rows, seen))[known]
        return seen, delays


def _times(rows: History, iterations: NDArray[np.int64]) -> NDArray[np.float64]:
    """Returns times of the rows of these iterations [s]; NaN for a missing row."""
    at = np.minimum(np.searchsorted(rows.iteration, iterations), len(rows) - 1)
    times = (rows.time[at] - rows.time[0]) * 1e-9
    return np.where(rows.iteration[at] == iterations, times, np.nan)


def _refuse_wrong_rewards(span: _Span, segment: str) -> None:
    """Raises InvalidArgument for values `reward` and `rewards` that are no finite numbers."""
    ending = span.ending
    for mark in span.marks if ending is None else [*span.marks, ending]:
        where = f"the mark '{mark.name}' at row {mark.rows[segment]}"
        if "reward" in mark.values and not _is_number(mark.values["reward"]):
            raise InvalidArgument(
                f"{where} has reward={mark.values['reward']!r:.40}: a reward must be a finite "
                "number"
            )
        given = mark.values.get("rewards", []) if mark is ending else []
        if not isinstance(given, list) or not all(map(_is_number, given)):
            raise InvalidArgument(
                f"{where} has rewards={given!r:.40}: rewards must be a list of finite numbers"
            )


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and abs(value) <= sys.float_info.max


def _rewards(span: _Span, segment: str, every: int, steps: int) -> NDArray[np.float64]:
    """Returns each step's reward: `rewards` of the last mark, or sums of `reward` of marks."""
    rewards, ending = np.zeros(steps), span.ending
    given = ending.values.get("rewards") if ending is not None else None
    if given:
        places = np.arange(len(given)) * steps // len(given)
        np.add.at(rewards, places, np.asarray(given, np.float64))
        return rewards
    first = span.marks[0].rows[segment]
    for mark in [*span.marks[1:], *([] if ending is None else [ending])]:
        if "reward" in mark.values:
            step = (mark.rows[segment] - first - 1) // every
            rewards[min(max(step, 0), steps - 1)] += mark.values["reward"]
    return rewards


# ---------------------------------------------------------------------------- robots


def _segment(recording: "RecordingFile", segment: str | None) -> str:
    if segment is not None:
        return recording.chosen([segment])[0]
    moving = [name for name in recording if recording[name].schema["actuators"]]
    if len(moving) != 1:
        raise InvalidArgument(
            f"{recording.path} holds {len(moving)} robots ({', '.join(moving)}): choose one with "
            f"--segment, in Python with segment="
        )
    return moving[0]


def _sensors(segment: str, schema: dict[str, Any], fields: Sequence[str]) -> list[Column]:
    """Chooses the sensor values for a learner; by default no times and no absent values."""
    every = columns_of_part(schema, "extended")
    if not fields:
        times = ("capture_time", "capture_error")
        return [
            each
            for each in every
            if each.origin not in ("clock", "absent") and each.name.rpartition(".")[2] not in times
        ]
    names = set(chosen(segment, [each.name for each in every], fields))
    return [each for each in every if each.name in names]


def _names(schema: dict[str, Any], sensors: Sequence[Column]) -> dict[str, list[str]]:
    parts = {
        "desired": columns_of_part(schema, "desired"),
        "observed": columns_of_part(schema, "observed"),
        "extended": sensors,
    }
    return {
        part: [each.name.partition(".")[2] for each in columns] for part, columns in parts.items()
    }
