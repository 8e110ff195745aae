"""The journal in a recording: the same entries as a frontend reads, gaps, restarts, damage."""

from pathlib import Path

import numpy as np
import pytest

import o80
from o80.recording.recorded_epoch import RecordedEpoch
from o80.recording.recorder import Recorder


def recorded(path: Path) -> RecordedEpoch:
    (segment,) = o80.open(path).segments.values()
    return segment.epochs[-1]


def play(arm: o80.Frontend, commands: int) -> None:
    for i in range(commands):
        arm.add_command("elbow", 0.1 * (i % 20), iterations=3)
        arm.add_command("shoulder", 0.05 * (i % 20), mode="overwrite")
        arm.burst(3)


def test_the_journal_of_a_file_is_that_of_the_robot(arm: o80.Frontend, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
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


def test_entries_are_chosen_by_their_number(arm: o80.Frontend, tmp_path: Path) -> None:
    with o80.Recording(tmp_path / "run.mcap", arm):
        play(arm, 10)
    epoch = recorded(tmp_path / "run.mcap")

    assert repr(epoch.journal(since=40)) == repr(arm.journal(since=40))
    with pytest.raises(o80.InvalidArgument, match="since must be"):
        epoch.journal(since=-1)


def test_entries_that_were_overwritten_are_a_gap(segment: str, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
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


def test_decisions_without_a_row_after_them_are_recorded(segment: str, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with o80.Backend(segment, ["a"]) as backend:
        backend.publish()
        with o80.Frontend(segment) as frontend, o80.Recording(path, segment) as recording:
            recording.flush()
            frontend.add_command("a", 1.0)
            frontend.pulse()
            backend.step()
            recording.flush()
            assert [entry.kind for entry in recorded(path).journal()] == ["taken"]
