"""Recordings in several files: complete files, read as one, continued and repaired."""

from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from processes import run_o80, until

import o80
import o80.recording.reader as reader
from o80.recording.reader import files_of
from o80.recording.recorder import Recorder


def play(arm: o80.Frontend, recorder: Recorder, polls: int) -> None:
    for i in range(polls):
        arm.add_command("elbow", 0.1 * (i % 9), iterations=20)
        arm.burst(20)
        recorder.poll()


def in_parts(arm: o80.Frontend, folder: Path, polls: int) -> Path:
    """A recording in several files."""
    recorder = Recorder(folder / "run.mcap", [arm.segment], split="8k")
    play(arm, recorder, polls)
    recorder.finish()
    return folder / "run.mcap"


def messages_of(path: Path) -> int:
    with path.open("rb") as file:
        return sum(1 for _ in make_reader(file, validate_crcs=True).iter_messages())


def test_a_folder_of_complete_files_is_read_as_one(arm: o80.Frontend, tmp_path: Path) -> None:
    path = in_parts(arm, tmp_path, 30)
    files = sorted(path.iterdir())
    recording = o80.open(path)
    (epoch,) = recording[arm.segment].epochs
    there = arm.history()

    assert len(files) > 3
    assert all(file.stat().st_size < 16_000 for file in files)
    assert all(messages_of(file) > 0 for file in files)
    assert recording.finished
    assert recording[arm.segment].schema == arm.schema
    assert epoch.history().rows.tobytes() == there.rows.tobytes()
    assert epoch.history(since=95, until=405).iteration.tolist() == list(range(95, 406))
    late = epoch.history(from_time=int(there.time[-250]))
    assert late.rows.tobytes() == there[-250:].rows.tobytes()
    assert epoch.history(7).rows.tobytes() == there[-7:].rows.tobytes()
    assert repr(epoch.journal()) == repr(arm.journal())
    assert (epoch.gaps, epoch.journal_gaps) == ([], [])
    assert sum(o80.open(file)[arm.segment].epochs[0].rows for file in files) == epoch.rows == 601


def test_files_end_after_a_time(process: o80.robots.Process, path: Path) -> None:
    with process.frontend() as arm, o80.Recording(path, arm, split="0.05s") as recording:
        until(lambda: len(list(path.iterdir())) >= 4)
        recording.mark("end")
    iteration = o80.open(path)[process.segment].history().iteration

    assert np.all(np.diff(iteration) == 1)
    assert [mark.name for mark in o80.open(path).marks] == ["end"]


@pytest.mark.parametrize(("lost", "size"), [(100, 0), (100, 5), (100, 20), (0, 3000), (0, 6000)])
def test_a_recorder_killed_between_two_files_or_in_the_last_one_is_continued(
    lost: int, size: int, arm: o80.Frontend, tmp_path: Path
) -> None:
    path = in_parts(arm, tmp_path, 20)
    *_, before, last = sorted(path.iterdir())
    before.write_bytes(before.read_bytes()[: -lost or None])  # not finished
    last.write_bytes(last.read_bytes()[:size])  # just created
    assert o80.open(path)[arm.segment].epochs[0].rows > 300
    o80.Recording(path, arm, proceed=True, split="8k").close()
    recording = o80.open(path)

    assert recording.finished
    assert recording[arm.segment].history().rows.tobytes() == arm.history().rows.tobytes()
    assert repr(recording[arm.segment].epochs[0].journal()) == repr(arm.journal())
    assert all(messages_of(file) > 0 for file in sorted(path.iterdir()))


def test_repair_completes_every_file(arm: o80.Frontend, tmp_path: Path) -> None:
    path = in_parts(arm, tmp_path, 20)
    for file in sorted(path.iterdir())[-2:]:
        file.write_bytes(file.read_bytes()[:-50])

    said = run_o80("repair", path).stdout
    assert said.count("is complete now") == said.count("bytes after them removed") == 2
    assert o80.open(path).finished

    for file in path.iterdir():
        file.write_bytes(b"")  # of a recorder that was killed at once
    assert run_o80("repair", path).stdout.count("held no rows") == len([*path.iterdir()])


def bytes_in(folder: Path) -> int:
    return sum(file.stat().st_size for file in folder.iterdir())


def test_the_oldest_files_without_a_mark_are_deleted(arm: o80.Frontend, path: Path) -> None:
    recorder = Recorder(path, [arm.segment], split="8k", keep="220k")
    play(arm, recorder, 12)
    marked = recorder.file.path
    recorder.mark("of the program")
    play(arm, recorder, 12)
    arm.mark("of a frontend")
    for _ in range(60):
        play(arm, recorder, 1)
        assert bytes_in(path) <= 220_000
    recorder.finish()
    read = o80.open(path)
    assert bytes_in(path) <= 220_000
    assert marked.exists()
    assert not (path / "0000.mcap").exists()
    assert [mark.name for mark in read.marks] == ["of the program", "of a frontend"]
    newest = read[arm.segment].history(60)
    assert newest.rows.tobytes() == arm.history(60).rows.tobytes()


def test_files_that_are_deleted_while_they_are_read_do_no_harm(
    arm: o80.Frontend, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder = Recorder(path, [arm.segment], split="8k")
    play(arm, recorder, 12)
    arm.mark("of a frontend")
    recorder.finish()
    read = o80.open(path)
    files = files_of(path)
    files[0].unlink()
    for use in (read[arm.segment].history, lambda: read.marks):
        with pytest.raises(o80.RecordingError, match=r"0000.mcap was deleted .* again"):
            use()
    assert read.size == bytes_in(path)
    monkeypatch.setattr(reader, "in_order", lambda folder: files)  # listed before
    assert [file for file, _ in o80.open(path).scans] == files[1:]
    monkeypatch.setattr(reader, "files_of", lambda folder: files)  # deleted even later
    assert [file for file, _ in o80.open(path).scans] == files[1:]


def test_a_recorder_that_may_delete_nothing_stops(arm: o80.Frontend, tmp_path: Path) -> None:
    path = in_parts(arm, tmp_path, 10)
    there = {file: file.read_bytes() for file in path.iterdir()}
    recorder = Recorder(path, [arm.segment], proceed=True, split="8k", keep="220k")

    def record() -> None:
        for i in range(1000):
            recorder.mark("here", number=i)
            play(arm, recorder, 1)

    with pytest.raises(
        o80.RecordingError, match=r"exceed .* have marks or are from another recorder"
    ):
        record()
    recorder.finish()
    assert bytes_in(path) <= 220_000
    *others, _ = sorted(there)  # the last one was continued
    assert all(file.read_bytes() == there[file] for file in others)
    read = o80.open(path)
    assert read.finished
    assert np.all(np.diff(read[arm.segment].history().iteration) == 1)


def test_files_are_read_by_their_numbers(arm: o80.Frontend, tmp_path: Path) -> None:
    path = in_parts(arm, tmp_path, 5)
    for i, file in enumerate(sorted(path.iterdir())[::-1]):
        file.rename(path / f"{9999 - i}.mcap")
    for _ in range(2):
        recorder = Recorder(path, [arm.segment], proceed=True, split="8k")
        play(arm, recorder, 15)
        recorder.finish()
    assert (path / "10001.mcap").exists()
    assert o80.open(path)[arm.segment].history().rows.tobytes() == arm.history().rows.tobytes()
