"""A recorder killed at any moment loses no row and no decision; its successor repeats none."""

import os
import random
import signal
from pathlib import Path

import numpy as np
import pytest

import o80
from o80.recording.reader import RecordingFile
from o80.recording.recorder import Recorder

KILLS = int(os.environ.get("O80_RECORDER_KILLS", "200"))
MAX_CHUNKS = 4  # of a recorder before it is killed


def record_for_ever(path: Path, name: str, split: str | None, progress: int) -> None:
    """In a forked child: records until it is killed, and tells of each chunk."""
    recorder = Recorder(path, [name], proceed=True, split=split)
    os.write(progress, b".")
    while True:
        if recorder.poll():
            os.write(progress, b".")


def kill_a_recorder(path: Path, name: str, split: str | None, chance: random.Random) -> None:
    """Starts one and kills it while it opens the file or writes a chunk."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            record_for_ever(path, name, split, write)
        finally:
            os._exit(1)
    os.close(write)
    for _ in range(chance.randint(0, MAX_CHUNKS)):
        os.read(read, 1)
    for _ in range(chance.randint(0, 20_000)):  # somewhere in the next step
        pass
    os.kill(child, signal.SIGKILL)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -signal.SIGKILL
    os.close(read)


def command(robot: o80.Frontend, chance: random.Random) -> None:
    """Gives the journal something to tell."""
    for _ in range(chance.randint(0, 3)):
        robot.add_command(0, chance.random(), iterations=chance.randint(1, 30))
        robot.pulse()


def recorded_iterations(path: Path, name: str) -> "np.ndarray[tuple[int], np.dtype[np.int64]]":
    try:
        file = RecordingFile(path)
    except o80.RecordingError:  # killed before it has begun a file
        return np.empty(0, np.int64)
    return file[name].history().iteration if len(file) else np.empty(0, np.int64)


@pytest.mark.check
@pytest.mark.timeout(300 + KILLS // 2)
@pytest.mark.parametrize("split", [None, "30k"])
def test_nothing_is_lost_and_nothing_is_written_twice(
    split: str | None, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("o80.recording.file_writer.LARGE", 0)  # two chunks in each poll
    chance = random.Random(7)
    start, rows = o80.robots.load("two_joints").start, 200_000 + 200 * KILLS
    with start(frequency=1000, history=rows, journal=64) as process, process.frontend() as robot:
        name = process.segment
        for i in range(KILLS):
            command(robot, chance)
            kill_a_recorder(path, name, split, chance)
            if i % (1 + KILLS // 200) == 0:
                assert np.all(np.diff(recorded_iterations(path, name)) == 1)
        recorder = Recorder(path, [name], proceed=True, split=split)
        recorder.catch_up()
        recorder.finish()
        epoch = RecordingFile(path)[name].epochs[0]
        recorded, journal = epoch.history(), epoch.journal()
        first, last = int(recorded.iteration[0]), int(recorded.iteration[-1])
        there = robot.history(since=first, until=last)
        decisions = robot.journal(journal[0].number)

    assert len(recorded) > KILLS
    assert split is None or len(list(path.iterdir())) > KILLS // 50
    assert np.array_equal(recorded.iteration, np.arange(first, last + 1))
    still_there = recorded.select(since=int(there.iteration[0]))  # a slow machine kills for longer
    assert len(there) > KILLS
    assert still_there.rows.tobytes() == there.rows.tobytes()
    assert (epoch.gaps, epoch.journal_gaps) == ([], [])
    assert len(journal) > KILLS
    assert list(map(repr, journal)) == list(map(repr, decisions[: len(journal)]))
