"""Holes of a recording have a reason, wherever it is looked at or compared."""

import os
import shutil
import signal
from pathlib import Path

import pytest
import typer

import o80
from o80.cli.cut import cut, merge
from o80.cli.diff import diff
from o80.cli.info import info
from o80.cli.replay import replay
from o80.cli.save import repair
from o80.recording.epoch import EARLIER_FILE, OVERWRITTEN, Gap
from o80.recording.epoch_part import UNFINISHED
from o80.recording.recorder import Recorder
from o80.recording.scan import MAGIC

KILLED = "the recorder was killed"
LATE = "recording began later"


@pytest.fixture
def cut_off(segment: str, tmp_path: Path) -> Path:
    """Rows 0 to 30 of a run that went on; then its recorder was killed."""
    path = tmp_path / "cut.mcap"
    with o80.robots.load("two_joints").inline(segment) as arm:
        recorder = Recorder(path, [segment])
        arm.burst(30)
        recorder.catch_up()
        recorder.file.close()
        recorder._close_sources()
        arm.burst(10)
    return path


def exits(command: object, *words: object) -> int:
    assert callable(command)
    try:
        command(*words)
    except typer.Exit as end:
        return end.exit_code
    return 0


def test_a_recorder_that_died_and_was_continued_tells_what_it_missed(
    cut_off: Path, segment: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (epoch,) = o80.open(cut_off)[segment].epochs
    assert epoch.gaps == [Gap(31, None, "the recorder still runs, or was killed")]
    load = o80.robots.load("two_joints")
    load.inline(segment).close()  # a run that nobody records
    with load.inline(segment) as arm:
        arm.burst(20)
        recorder = Recorder(cut_off, [segment], proceed=True)
        recorder.catch_up()
    recorder.catch_up()
    recorder.finish()
    first, second = o80.open(cut_off)[segment].epochs
    assert first.gaps == [Gap(31, None, KILLED)]
    assert (second.gaps, second.missing) == ([], 0)
    assert (first.end, second.end) == ("", "stopped")
    assert first.interruption is None
    assert second.interruption is not None
    assert first.time_range[1] + first.wall_offset == second.interruption.since
    assert second.interruption.since < second.interruption.until

    info(str(cut_off))
    said = capsys.readouterr().out
    assert f"{segment}: rows from 31 on are missing: {KILLED}" in said
    assert f"{segment}/1: runs before this one may be missing" in said
    assert exits(replay, str(cut_off)) == exits(diff, str(cut_off), str(cut_off)) == 2
    said = capsys.readouterr().out
    assert f"{segment}: 31 rows, identical; rows from 31 on are missing: {KILLED}" in said
    assert said.count("runs before this one may be missing") == 3
    assert not o80.replay(cut_off).identical


def test_a_repaired_recording_lacks_its_end(
    cut_off: Path, segment: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    repair(cut_off)
    (epoch,) = o80.open(cut_off)[segment].epochs
    assert epoch.gaps == [Gap(31, None, KILLED)]
    parts = tmp_path / "begin.mcap", tmp_path / "end.mcap"
    cut(cut_off, parts[0], "", "0.01")
    cut(cut_off, parts[1], "0.02", "")
    assert o80.open(parts[0])[segment].epochs[0].gaps == []  # was told to end there
    late = Gap(0, 19, "cut away")
    assert o80.open(parts[1])[segment].epochs[0].gaps == [late, Gap(31, None, KILLED)]
    merge([*parts], tmp_path / "both.mcap")
    (both,) = o80.open(tmp_path / "both.mcap")[segment].epochs
    hole = Gap(11, 19, "no recording that was merged has them")
    assert both.gaps == [hole, Gap(31, None, KILLED)]
    assert both.missing == 9
    cut(cut_off, tmp_path / "thin.mcap", "", "", None, 10)
    (thin,) = o80.open(tmp_path / "thin.mcap")[segment].epochs
    assert thin.gaps == [Gap(1, 30, "every 10th row was kept"), Gap(31, None, KILLED)]
    assert thin.missing == 27
    capsys.readouterr()
    assert exits(diff, str(cut_off), str(tmp_path / "thin.mcap")) == 2
    assert f"{segment}: 4 rows, identical" in capsys.readouterr().out


def test_a_run_that_is_recorded_late_is_not_whole(
    segment: str, path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with o80.robots.load("two_joints").inline(segment, history=16) as arm:
        arm.burst(100)
        recorder = Recorder(path, [segment])
        recorder.catch_up()
        arm.request("reset", seed=1)
        arm.burst(1)
        recorder.catch_up()
        last = arm.published
        arm.burst(60)
        recorder.catch_up()
        begin, oldest = recorder.sources[segment].begin, arm.oldest
        recorder.finish()
        assert recorder.missed == oldest - last - 1
    (epoch,) = o80.open(path)[segment].epochs
    assert epoch.gaps == [Gap(0, begin - 1, LATE), Gap(last + 1, oldest - 1, OVERWRITTEN)]
    assert epoch.missing == begin + oldest - last - 1
    assert exits(diff, str(path), str(path)) == 2
    assert f"{path}: rows 0 to {begin - 1} are missing: {LATE}" in capsys.readouterr().out
    (run,) = o80.replay(path)
    assert not run.identical
    assert f"rows before {run.first} were not compared" in str(run)
    assert begin < run.first <= last
    assert f"up to row {last}; then rows {last + 1} to {oldest - 1} are missing" in str(run)


def test_a_file_that_is_missing_in_a_folder_is_a_gap(arm: o80.Frontend, path: Path) -> None:
    with o80.Recording(path, arm, split="1k") as recording:
        for _ in range(3):
            arm.burst(20)
            recording.flush()
    (whole,) = o80.open(path)[arm.segment].epochs
    assert whole.gaps == []
    begins = [part.note.begin for part in whole._parts]
    assert len(begins) >= 3
    with (path / f"{len(begins):04}.mcap").open("wb") as next_file:
        for content in (b"", MAGIC):  # its recorder was killed as it began this file
            next_file.write(content)
            next_file.flush()
            (cut,) = o80.open(path)[arm.segment].epochs
            assert cut.gaps == [Gap(61, None, UNFINISHED)]
    Path(next_file.name).unlink()
    whole._parts[1].path.unlink()
    (epoch,) = o80.open(path)[arm.segment].epochs
    lost = begins[1], begins[2] - 1
    assert epoch.gaps == [Gap(*lost, "a file is missing, or was cut")]
    assert epoch.missing == lost[1] - lost[0] + 1
    whole._parts[0].path.unlink()  # as with keep
    (epoch,) = o80.open(path)[arm.segment].epochs
    assert epoch.gaps == [Gap(0, lost[1], EARLIER_FILE)]


def test_a_backend_that_was_killed_is_recorded_to_its_end(
    segment: str, path: Path, tmp_path: Path
) -> None:
    with o80.robots.load("two_joints").start(segment, bursting=True) as process:
        recorder = Recorder(path, [segment])
        with process.frontend() as robot:
            robot.burst(7)
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        recorder.catch_up()
        recorder.finish()
        o80.Recording(tmp_path / "saved.mcap", segment).close()
    for name in ("run", "saved"):
        (epoch,) = o80.open(tmp_path / f"{name}.mcap")[segment].epochs
        assert (epoch.rows, epoch.end, epoch.gaps) == (8, "killed", [])
    shutil.copy(path, tmp_path / "again.mcap")
    merge([path, tmp_path / "again.mcap"], tmp_path / "both.mcap")
    (epoch,) = o80.open(tmp_path / "both.mcap")[segment].epochs
    assert (epoch.rows, epoch.end, epoch.gaps) == (8, "killed", [])
