"""Starts recorded robots again and compares every row.

report = o80.replay("run.mcap")
assert report.identical, report
"""

import itertools
import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from o80.base.errors import DriverError, InvalidArgument, RecordingError, sentence
from o80.frontend.frontend import Frontend
from o80.joining.difference import Difference, RobotsDifferError, first_difference, same_bytes
from o80.replaying.conditions import (
    TOLERANCE,
    changes,
    other_arithmetic,
    reads_the_world,
)
from o80.replaying.entry_feed import EntryFeed, MotionRules
from o80.replaying.recorded_run import ROWS_AT_ONCE, LiveRun, RecordedRun, runs_in
from o80.replaying.report import ReplayReport, RunReport
from o80.replaying.runner import OtherRobot, Runner, with_driver, without_driver
from o80.replaying.start import (
    SlotsKept,
    Start,
    find_fresh_start,
    find_kept,
    find_rest,
    find_start,
)
from o80.rows.actuators import blending
from o80.rows.columns import columns_of
from o80.rows.history import History

if TYPE_CHECKING:
    from o80.recording.reader import RecordingFile

Progress = Callable[[str, int, int], None]

_HISTORY = 4 * ROWS_AT_ONCE  # rows that the replay keeps: those of a block, and fresh starts


def replay(
    source: "str | os.PathLike[str] | RecordingFile | Frontend",
    *,
    segment: str | None = None,
    robot: OtherRobot = None,
    options: Mapping[str, Any] | None = None,
    tolerances: Mapping[str, float] | None = None,
    ignore: tuple[str, ...] = (),
    since: int | None = None,
    driver: bool = True,
    progress: Progress | None = None,
) -> ReplayReport:
    """Repeats recorded runs with the same robots and options, and compares every row bit for bit.

    source: a recording, or a frontend whose segment holds all rows and decisions of its run.
    segment: replay only this segment of the recording.
    robot: name or library of the robot to start instead of the recorded one, for example after a
        change; or a mapping from recorded robot names to these. None: the robots that are found
        here by the recorded names. A library that only the recording names is not loaded.
    options: options of the robot that differ from the recorded ones. A recorded option that names
        a file must be given if the file has another content here.
    tolerances, ignore: by column, as for `o80 diff`. None: bit for bit, but with a tolerance if
        another build of o80, C library or processor recorded the run; a note in the report says so.
        {}: bit for bit.
    since: begin at the first reset, restored snapshot or snapshot at rest in this iteration or
        later. None: at row 0, or at the first of these that the recording holds. Without a driver:
        at the first row in which nothing acts, or at the first fresh start.
    driver: False starts no robot, as for hardware.
    progress: called with the name of a run, its rows compared, and all its rows.

    Only robots that declare themselves simulated are started. For all others, and with
    driver=False, only the backend runs, and no hardware is touched: the backend reads the recorded
    observed and extended values and obeys the recorded halts, interrupts and fresh starts of the
    driver; its desired states are compared. The report says so. Raises InvalidArgument for wrong
    arguments or changed files, RecordingError if the only run is unreadable, DriverError for a
    robot that is unknown or fails.
    """
    runs, reports = _runs_of(source, segment), []
    for run in runs:
        replayed = RunReplay(run, robot, options, tolerances, ignore, since, driver, progress)
        try:
            reports.append(replayed.report())
        except RecordingError as error:
            if len(runs) == 1:
                raise
            reports.append(RunReport(segment=run.segment, number=run.number, gap=str(error)))
    return ReplayReport(tuple(reports))


def _runs_of(
    source: "str | os.PathLike[str] | RecordingFile | Frontend", segment: str | None
) -> list[RecordedRun]:
    if isinstance(source, Frontend):
        return [LiveRun(source)]
    from o80.recording.reader import RecordingFile

    recording = source if isinstance(source, RecordingFile) else RecordingFile(source)
    runs: list[RecordedRun] = [*runs_in(recording, segment)]
    if not runs:
        raise InvalidArgument(f"{recording.path} has no segment: no robot ran meanwhile")
    return runs


@dataclass
class RunReplay:
    """Replays one run; the arguments are those of `replay`."""

    run: RecordedRun
    robot: OtherRobot = None
    options: Mapping[str, Any] | None = None
    tolerances: Mapping[str, float] | None = None
    ignore: tuple[str, ...] = ()
    since: int | None = None
    driver: bool = True
    progress: Progress | None = None

    def __post_init__(self) -> None:
        self._no_driver = reads_the_world(self.run.schema) if self.driver else "as requested"
        self._start = Start()
        self._rows = 0
        self._times = [0, 0]  # times of the first and the last compared row [ns]
        self._gap = ""
        self._notes: list[str] = []

    def report(self) -> RunReport:
        begin = time.monotonic()
        difference = self._compare()
        return RunReport(
            segment=self.run.segment,
            number=self.run.number,
            first=self._start.row,
            rows=self._rows,
            difference=difference,
            gap="" if difference else self._gap,
            missing=tuple(self._missing() if difference is None else ()),
            driver=not self._no_driver,
            unused=bool(self._no_driver and (self.robot or self.options)),
            notes=tuple(self._notes),
            seconds=time.monotonic() - begin,
            recorded_seconds=(self._times[1] - self._times[0]) * 1e-9,
        )

    def _missing(self) -> Iterator[str]:
        """Yields texts about rows that were not compared, unless the caller excluded them."""
        if self._rows and self._start.row > 0 and self.since is None:
            yield f"rows before {self._start.row} were not compared"
        if not self._gap:
            yield from self.run.missing

    def _compare(self) -> Difference | None:
        start = self._found_start()
        if start is None:
            return None
        self._start = start
        if start.row > 0:
            begins = "at rest in" if start.is_at_rest else f"with the {start.request} of"
            if start.before:
                begins = "with the snapshot of"
            self._notes.append(f"the replay begins {begins} row {start.row}")
        # without a driver, a restored snapshot is read as any other row
        known = Start() if self._no_driver else start
        rules = self._motion_rules()
        slots = SlotsKept(self.run.schema, known)
        feed = EntryFeed(self.run.entries(), start, slots, rules)
        blocks = self._whole(self.run.blocks())
        first = next(blocks, None)
        if first is None:
            return None
        with self._started() as runner:
            runner.begin_at(start)
            for block in itertools.chain([first], blocks):
                runner.native.add(feed.read(int(block.iteration[-1])))
                if int(block.iteration[-1]) > feed.until:
                    block = _settled(block.select(until=feed.until))
                    self._gap = feed.gap
                if not len(block) or int(block.iteration[0]) > feed.until:
                    return None
                difference = self._compare_block(runner, block)
                if difference is not None or self._gap:
                    return difference
        return None

    def _motion_rules(self) -> MotionRules:
        rules = MotionRules(self.run.schema, self.run.provenance.motion_rules)
        if rules.differ:
            self._notes.append(
                f"{rules}: rows are compared up to the first command that is not linear, or is of "
                f"an actuator with a limit of speed"
            )
        return rules

    def _found_start(self) -> Start | None:
        """Returns where to begin, or None; then `_gap` says why there is no start."""
        rows = (int(block.iteration[0]) for block in self.run.blocks() if len(block))
        first = next(rows, None)
        if first is None:
            return Start()
        if self.since is None and first == 0:
            entry = next(iter(self.run.entries()), None)
            if entry is None or not entry.missed:
                return Start()
        found = self._first_start(max(first, self.since or 0))
        if found is None and first == 0 and self.since is None:
            return Start()  # says what the journal lacks
        if found is None and self.since is not None:
            self._gap = f"no {self._beginnings(' and no ')} is recorded from row {self.since} on"
        elif found is None:
            self._gap = (
                f"the first recorded row is row {first}: a replay begins at row 0, at a "
                f"{self._beginnings(', or at a ')}, and none is recorded. Record before the "
                f"robot overwrites its first rows (--history) and without --from-now, or with "
                f"--snapshots 60"
            )
        if found is None and not self._no_driver:
            self._gap += (
                ". Without its driver (--without-driver, in Python driver=False) a replay may "
                "also begin at a row in which nothing acts"
            )
        return found

    def _first_start(self, since: int) -> Start | None:
        ways = (find_rest, find_fresh_start) if self._no_driver else (find_start, find_kept)
        found = (find(self.run, since) for find in ways)
        return min((each for each in found if each), key=lambda each: each.row, default=None)

    def _beginnings(self, between: str) -> str:
        begins = (
            ["row at rest", "reset", "resume"]
            if self._no_driver
            else ["reset", "restored snapshot", "snapshot at rest"]
        )
        return between.join(begins)

    def _whole(self, blocks: Iterator[History]) -> Iterator[History]:
        """Yields the rows from the start to the first gap.

        No block ends with a fresh start, because decisions behind that row belong to its step.
        """
        held: History | None = None
        expected = self._start.row
        for each in blocks:
            block = each.select(since=self._start.row) if len(each) else each
            if not len(block):
                continue
            found = int(block.iteration[0])
            if found != expected:
                self._gap = f"rows {expected} to {found - 1} are missing"
                break
            jumps = np.flatnonzero(np.diff(block.iteration) != 1)
            if len(jumps):  # thinned
                block = block[: int(jumps[0]) + 1]
            expected = int(block.iteration[-1]) + 1
            whole = block if held is None else History._joined(block._decoder, [held, block])
            held = None
            settled = _settled(whole)
            if len(settled) < len(whole):
                held = whole[len(settled) :]
            if len(settled):
                yield settled
        if held is not None:
            yield held

    # ------------------------------------------------------------------ the robot

    def _started(self) -> AbstractContextManager[Runner]:
        if not self._no_driver:
            return with_driver(self.run, self.robot, self.options or {}, _HISTORY)
        self._notes.append(
            f"compared: desired states, from the recorded readings; not repeated: readings of the "
            f"world. No driver was started: {self._no_driver}"
        )
        if self.robot or self.options:
            self._notes.append("the robot and the options that were given are not used")
        if blended := [f"desired.{name}" for name in blending(self.run.schema)]:
            self.ignore = (*self.ignore, *blended)
            self._notes.append(
                f"not compared, because code of the driver interpolates them: {', '.join(blended)}"
            )
        return without_driver(self.run, _HISTORY)

    def _compare_block(self, runner: Runner, block: History) -> Difference | None:
        first, last = int(block.iteration[0]), int(block.iteration[-1])
        native = runner.native
        try:
            runs = runner.run(block, self._start)
        except DriverError as error:
            return Difference(first, "driver", ("started", str(error)))
        with Frontend(native.segment, read_only=True, dead=True, timeout=5) as frontend:
            replayed = frontend.history(since=first, until=last)
            if first == self._start.row:
                self._note_changes(frontend)
        try:
            found = self._first_difference(block[: len(replayed)], replayed)
        except RobotsDifferError as error:
            raise InvalidArgument(
                f"robot '{self.run.schema['robot']}' is described differently than when segment "
                f"'{self.run.segment}' was recorded: {sentence(error)} Give the robot as it was "
                f"then (--robot FILE.so, in Python robot=), or compare only desired states "
                f"(--without-driver, in Python driver=False)"
            ) from None
        decided = native.mismatch
        if decided is not None and (found is None or decided[0] < found.iteration):
            found = Difference(decided[0], decided[1], (decided[2], decided[3]))
        if found is None and not runs:
            found = Difference(native.next, runner.who, ("went on", native.fault or "ended"))
        self._count(block if found is None else block.select(until=found.iteration - 1))
        return found

    def _note_changes(self, frontend: Frontend) -> None:
        """Notes changes since the run, and adds a tolerance where bits need not agree."""
        recorded, now = self.run.provenance, frontend.provenance
        if not self._no_driver:
            self._notes += changes(recorded, now)
        why = other_arithmetic(recorded, now, self.run.machine)
        if not why:
            return
        if self.tolerances is None:
            self.tolerances = dict.fromkeys(self._numbers(frontend), TOLERANCE)
            why += f": numbers are compared with a tolerance of {TOLERANCE:g}"
        self._notes.append(why)

    @staticmethod
    def _numbers(frontend: Frontend) -> list[str]:
        parts = ["desired", "observed", "off_plan"] if frontend.actuators else []
        return [*parts, "extended"] if "extended" in frontend._layout.schema else parts

    def _first_difference(self, recorded: History, replayed: History) -> Difference | None:
        if same_bytes(recorded, replayed):
            return None
        world = [each.name for each in columns_of(recorded.schema) if each.origin == "world"]
        return first_difference(
            recorded, replayed, ignore=[*self.ignore, *world], tolerances=self.tolerances
        )

    def _count(self, compared: History) -> None:
        if not len(compared):
            return
        if self._rows == 0:
            self._times[0] = int(compared.time[0])
        self._rows += len(compared)
        self._times[1] = int(compared.time[-1])
        if self.progress is not None:
            self.progress(self.run.segment, self._rows, self.run.rows)


def _settled(block: History) -> History:
    """Returns the block without fresh starts at its end: later decisions belong to their step."""
    settled = np.flatnonzero(block.rows["fresh"] == 0)
    return block[: int(settled[-1]) + 1 if len(settled) else 0]
