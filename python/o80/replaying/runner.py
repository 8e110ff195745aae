"""Starts the recorded robot, or its backend alone, for a replay."""

import os
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

import o80._core as _core
import o80.robots.robot as robots
from o80.base.loop_options import text_of
from o80.replaying.start import Start
from o80.replaying.trust import options_of, robot_of

if TYPE_CHECKING:
    from o80.replaying.recorded_run import RecordedRun
    from o80.rows.history import History

OtherRobot = str | os.PathLike[str] | Mapping[str, str | os.PathLike[str]] | None

# the run options that decide what a backend does; the others concern its process only
_OF_BACKEND = ("lanes", "lane_blocks")


@dataclass(frozen=True)
class Runner:
    """A started replay, which publishes its rows in a segment of its own."""

    native: _core.Replay | _core.DriverlessReplay
    who: str  #: part that may fail, for error messages: "driver" or "backend"
    period: int  #: [ns]

    def begin_at(self, start: Start) -> None:
        """Loads the snapshots of the start and begins at its row."""
        if start.row == 0:
            return
        if isinstance(self.native, _core.Replay):
            for slot, state in start.snapshots.items():
                self.native.load_snapshot(slot, state)
            if start.is_at_rest:
                self.native.begin_at_rest(start.row, start.before, start.slot)
                return
        elif start.is_at_rest:
            self.native.begin_at_rest(start.row)
            return
        self.native.begin_at(start.row)

    def run(self, block: "History", start: Start) -> bool:
        """Runs one iteration for each row; False if the robot or its backend has ended."""
        if isinstance(self.native, _core.Replay):
            times = block.time
            if start.row == int(block.iteration[0]) > 0:  # at a later start, that of the row before
                times = np.concatenate([times[:1] - self.period, times])
            return self.native.run(np.ascontiguousarray(times))
        return self.native.run(np.ascontiguousarray(block.rows).tobytes())


@contextmanager
def with_driver(
    run: "RecordedRun", robot: OtherRobot, options: Mapping[str, Any], history: int
) -> Iterator[Runner]:
    """Starts the recorded robot, or another one, with the recorded options.

    history: rows to keep. Raises DriverError for an unknown robot, InvalidArgument for its options.
    """
    chosen = robot.get(run.schema["robot"]) if isinstance(robot, Mapping) else robot
    loaded = robots.load(chosen or robot_of(run))
    own = options_of(run, loaded, {name: text_of(value) for name, value in options.items()})
    name = _core.unused_segment_name(loaded.name)
    period = run.schema["period"]
    given = loaded._library, name, _loop_options(run, history), [*own.items()], period
    with ExitStack() as stack:
        stack.callback(_core.clean, name)
        yield Runner(stack.enter_context(closing(_core.Replay(*given))), "driver", period)


@contextmanager
def without_driver(run: "RecordedRun", history: int) -> Iterator[Runner]:
    """Starts a backend of the recorded description, which reads the recorded values.

    history: rows to keep. Raises InvalidArgument if the backend refuses the recorded options.
    """
    name = _core.unused_segment_name("replay")
    period = run.schema["period"]
    given = run.description, name, _loop_options(run, history), period
    with ExitStack() as stack:
        stack.callback(_core.clean, name)
        yield Runner(
            stack.enter_context(closing(_core.DriverlessReplay(*given))), "backend", period
        )


def _loop_options(run: "RecordedRun", history: int) -> list[tuple[str, str]]:
    recorded, schema = run.provenance.run_options, run.schema
    loop = {name: recorded[name] for name in _OF_BACKEND if name in recorded}
    loop |= {"bursting": text_of(schema["bursting"]), "stale": schema["stale"]}
    loop |= {"silence": text_of(schema["silence"])} if schema["silence"] else {}
    return [*loop.items(), ("history", str(history))]
