"""Recording robots: restarts, patterns, gaps, marks, and what stands in the way."""

import contextlib
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from published_rows import messages_of

import o80
from o80.recording.recorded_epoch import RecordedEpoch
from o80.recording.recorder import Recorder


def test_a_program_records_what_it_does(arm: o80.Frontend, path: Path) -> None:
    arm.burst(10)
    with o80.Recording(path, arm, from_now=True) as recording:
        recording.mark("episode", number=3, ball=[0.1, 0.2])
        arm.add_command("elbow", 0.5, iterations=50)
        arm.burst(50)
        recording.flush()
        assert recording.rows == 51
        recording.mark("end")
    file = o80.open(path)
    first, last = file.marks

    assert file.finished
    assert file[arm.segment].history().iteration.tolist() == list(range(10, 61))
    assert (first.name, first.rows) == ("episode", {arm.segment: 10})
    assert first.values == {"number": 3, "ball": [0.1, 0.2]}
    assert last.rows == {arm.segment: 60}
    assert first.time <= last.time


@pytest.mark.parametrize("split", [None, "8k"])
def test_a_robot_that_restarts_goes_on_in_the_same_recording(
    split: str | None, segment: str, path: Path
) -> None:
    recorder = Recorder(path, [segment], split=split)  # before the robot is there
    rows = []
    for count in (300, 200):
        with o80.robots.load("two_joints").inline(segment) as arm:
            for _ in range(count // 20):
                arm.burst(20)
                recorder.poll()
            while recorder.sources[segment].newest != count:
                recorder.catch_up()
            recorder.catch_up()
            rows.append(arm.history().rows.tobytes())
    recorder.finish()
    recorded = o80.open(path)[segment]

    assert split is None or len(list(path.iterdir())) > 3
    assert [epoch.rows for epoch in recorded.epochs] == [301, 201]
    assert [epoch.history().rows.tobytes() for epoch in recorded.epochs] == rows
    first, second = recorded.epochs
    assert first.time_range[1] + first.wall_offset < second.time_range[0] + second.wall_offset
    with pytest.raises(o80.InvalidArgument, match=r"2 epochs.*\.epochs\[-1\]"):
        recorded.history()


def test_segments_of_a_pattern_join_when_they_appear(segment: str, path: Path) -> None:
    recorder = Recorder(path, [f"{segment}*"])
    load = o80.robots.load("two_joints")
    with load.inline(f"{segment}-a") as one, load.inline(f"{segment}-b") as other:
        recorder._search()
        one.burst(5)
        other.burst(7)
        recorder.catch_up()
    recorder.finish()
    file = o80.open(path)

    rows = {name: file[name].epochs[0].rows for name in file}
    assert rows == {f"{segment}-a": 6, f"{segment}-b": 8}
    with pytest.raises(KeyError, match=f"there are: {segment}-a, {segment}-b"):
        file["arm"]


def test_rows_are_counted_while_a_segment_joins(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "run.mcap", ["nobody*"])
    sources: dict[str, Any] = recorder.sources

    class Joined:
        @property
        def rows(self) -> int:
            sources["another"] = self  # as the thread of a recording may at any moment
            return 1

    sources["one"] = Joined()
    assert recorder.rows == 1
    recorder.file.close()


class RestartsWhenAsked:
    """A frontend whose backend publishes five rows and is restarted when its life is asked for."""

    def __init__(self, frontend: Any, restart: Callable[[], None]) -> None:
        self._frontend, self._restart = frontend, restart

    def __getattr__(self, name: str) -> Any:
        return getattr(self._frontend, name)

    @property
    def alive(self) -> bool:
        self._restart()
        return False


def test_the_last_rows_before_a_restart_are_not_lost(segment: str, path: Path) -> None:
    load = o80.robots.load("two_joints").inline
    with contextlib.ExitStack() as stack:
        arm = load(segment)
        recorder = Recorder(path, [segment])
        recorder.catch_up()

        def restart() -> None:
            if not arm.closed:
                arm.burst(5)
                arm.close()
                stack.enter_context(load(segment))

        source: Any = recorder.sources[segment]
        source.frontend = RestartsWhenAsked(source.frontend, restart)
        source._attempt_at = 0.0  # it may attach at once
        while not arm.closed or source.newest != 0:
            recorder.poll()
        recorder.finish()

    assert [epoch.rows for epoch in o80.open(path)[segment].epochs] == [6, 1]


def test_marks_of_frontends_are_recorded_at_their_rows(arm: o80.Frontend, path: Path) -> None:
    arm.mark("before")  # still in the ring when the recorder begins
    arm.burst(10)
    with o80.Recording(path, arm.segment):
        arm.burst(20)
        arm.mark("first")
        arm.burst(20)
        with o80.Frontend(arm.segment) as other:
            other.mark("second: \u00bd l")
        arm.burst(5)
    file = o80.open(path)
    epoch = file[arm.segment].epochs[0]
    assert [(mark.name, mark.rows) for mark in file.marks] == [
        ("before", {arm.segment: 1}),
        ("first", {arm.segment: 31}),
        ("second: \u00bd l", {arm.segment: 51}),
    ]
    times = epoch.history().time
    logged = [time for time, _ in messages_of(path, "/o80/marks")]
    assert logged == [int(times[row]) + epoch.wall_offset for row in (1, 31, 51)]


def test_chunks_grow_to_a_quarter_of_what_the_robot_holds(segment: str, path: Path) -> None:
    with o80.robots.load("two_joints").inline(segment, history=1000) as arm:
        arm.burst(5000)
        recorder = Recorder(path, [segment])
        assert recorder.is_due(), "in the first seconds chunks are short"
        recorder._begun -= 60.0
        recorder.catch_up()
        recorder._polled = math.inf  # the time since then is no reason
        assert not recorder.is_due()
        arm.burst(200)
        assert not recorder.is_due()
        arm.burst(100)
        assert recorder.is_due()
        arm.burst(400)
        recorder.file.close()  # killed, when it was late
        with o80.Recording(path, segment, proceed=True):
            arm.burst(10)
        rows = o80.open(path)[segment].history()
        assert np.array_equal(np.diff(rows.iteration), np.ones(len(rows) - 1))
        assert rows.iteration[-1] == 5710


def test_a_chunk_is_due_when_the_journal_fills(segment: str, path: Path) -> None:
    with o80.robots.load("two_joints").inline(segment, journal=0.5) as arm:
        recorder = Recorder(path, [segment])
        arm.burst(20_000)
        recorder._begun -= 60.0
        recorder.catch_up()
        recorder._polled = math.inf
        commands = 0
        while not recorder.is_due() and commands < 4000:  # before the rows are a reason
            arm.add_command("elbow", 0.1)
            arm.burst(1)
            commands += 1
        recorder.catch_up()
        recorder.finish()
        assert 10 < commands < 4000
        assert not o80.open(recorder.path)[segment].epochs[0].journal_gaps


def test_a_closed_recording_says_so(arm: o80.Frontend, path: Path) -> None:
    recording = o80.Recording(path, arm)
    recording.close()
    recording.close()

    with pytest.raises(o80.Closed, match=r"run\.mcap was closed"):
        recording.flush()
    with pytest.raises(o80.Closed):
        recording.mark("late")


# -------------------------------------------------------------------------------------- the journal


def recorded(path: Path) -> RecordedEpoch:
    (segment,) = o80.open(path).segments.values()
    return segment.epochs[-1]


def play(arm: o80.Frontend, commands: int) -> None:
    for i in range(commands):
        arm.add_command("elbow", 0.1 * (i % 20), iterations=3)
        arm.add_command("shoulder", 0.05 * (i % 20), mode="overwrite")
        arm.burst(3)


def test_the_journal_of_a_file_is_that_of_the_robot(arm: o80.Frontend, path: Path) -> None:
    with o80.Recording(path, arm) as recording:
        play(arm, 10)
        arm.request("reset", seed=3)
        recording.flush()
        arm.add_trajectory(np.linspace([0.0, 0.1], [0.5, 0.2], 20), iterations=2)
        arm.pulse_and_wait()
        arm.halt("enough")
        arm.burst(2)
    entries = recorded(path).journal()

    assert repr(entries) == repr(arm.journal())
    assert {"taken", "status", "halt", "burst_ended", "fresh_start"} <= {e.kind for e in entries}
    assert recorded(path).journal_gaps == []


def test_entries_are_chosen_by_their_number(arm: o80.Frontend, path: Path) -> None:
    with o80.Recording(path, arm):
        play(arm, 10)
    epoch = recorded(path)

    assert repr(epoch.journal(since=40)) == repr(arm.journal(since=40))
    with pytest.raises(o80.InvalidArgument, match="since must be"):
        epoch.journal(since=-1)


def test_entries_that_were_overwritten_are_a_gap(segment: str, path: Path) -> None:
    with o80.robots.load("two_joints").inline(segment, journal=0.5) as arm:
        recorder = Recorder(path, [segment])
        play(arm, 5)
        recorder.catch_up()
        play(arm, 3000)
        recorder.catch_up()
        recorder.finish()
        there = arm.journal()
    epoch = recorded(path)
    ((first, last),) = epoch.journal_gaps
    entries = epoch.journal()
    (after,) = (entry for entry in entries if entry.missed)

    assert first <= last < after.number
    assert after.missed >= last - first + 1
    # the recording still knows names and blocks that the ring has lost
    numbers = [(entry.number, entry.kind, entry.id) for entry in there if entry.number > last]
    assert [(entry.number, entry.kind, entry.id) for entry in entries][-len(numbers) :] == numbers


def test_decisions_without_a_row_after_them_are_recorded(segment: str, path: Path) -> None:
    with o80.Backend(segment, ["a"]) as backend:
        backend.publish()
        with o80.Frontend(segment) as frontend, o80.Recording(path, segment) as recording:
            recording.flush()
            frontend.add_command("a", 1.0)
            frontend.pulse()
            backend.step()
            recording.flush()
            assert [entry.kind for entry in recorded(path).journal()] == ["taken"]
