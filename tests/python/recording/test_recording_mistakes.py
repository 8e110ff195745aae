"""Careless use of recordings: wrong names, two recorders, damaged files, formats that are not."""

import itertools
import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from processes import run_o80, run_python

import o80
from o80.cli.diff import diff
from o80.cli.export import export
from o80.cli.plot import plot
from o80.recording import source
from o80.recording.chunks import HEAD
from o80.recording.output import opened
from o80.recording.recorder import Recorder
from o80.recording.scan import scan


def refused(*words: str | Path) -> str:
    """Error of a command, which is one line and not a trace."""
    done = run_o80(*words, code=1, env=os.environ | {"COLUMNS": "200"})
    return " ".join(done.stderr.split())


# ---------------------------------------------------------------------- names


@pytest.mark.parametrize(
    ("name", "options", "said"),
    [
        *((name, {}, r"must end in \.mcap") for name in ("run", "run.npz", "", "run.mcap.gz")),
        ("folder/run.mcap", {}, "there is no folder .*folder"),
        ("run.mcap", {"compression": "gzip"}, "zstd, lz4, none, got 'gzip'"),
        *(
            ("run.mcap", {"split": text}, "split must be a size such as 500M")
            for text in ("", "1", "M", "-1M", "0s", "nans", "10 parsec", "1e400G")
        ),
        ("run.mcap", {"keep": "1G"}, "keep needs split"),
        ("run.mcap", {"snapshots": -1.0}, "snapshots must be a positive number"),
        ("run.mcap", {"split": "1M", "keep": "10min"}, "a size such as 50G"),
        ("run.mcap", {"split": "1M", "keep": "1M"}, "at least twice split"),
    ],
)
def test_what_cannot_be_recorded_is_refused_and_leaves_no_file(
    name: str, options: dict[str, Any], said: str, arm: o80.Frontend, tmp_path: Path
) -> None:
    with pytest.raises(o80.Error, match=said):
        o80.Recording(tmp_path / name, arm, **options)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("content", "options", "said"),
    [
        (b"precious", {}, "exists"),
        (b"", {"split": "1M", "proceed": True}, "is a file"),
        (None, {}, "is a folder"),
        (None, {"proceed": True}, "is a folder"),
        (None, {"split": "1M"}, "exists"),
    ],
)
def test_what_is_there_is_not_written_to(
    content: bytes | None, options: dict[str, Any], said: str, path: Path
) -> None:
    path.mkdir() if content is None else path.write_bytes(content)
    with pytest.raises(o80.RecordingError, match=said):
        Recorder(path, ["arm"], **options)
    assert content is None or path.read_bytes() == content
    if content is None:
        with pytest.raises(o80.RecordingError, match="holds no recording"):
            o80.open(path)


def test_a_wrong_name_of_a_segment_leaves_no_file(path: Path, tmp_path: Path) -> None:
    for split in (None, "1M"):
        with pytest.raises(o80.Error, match="'two/joints' cannot name a segment"):
            o80.Recording(path, ["two/joints"], split=split)
    with pytest.raises(o80.InvalidArgument, match="at least one segment"):
        o80.Recording(path, [])
    said = refused("save", "nobody-*", "-o", path)
    assert "no segment matches 'nobody-*'" in said
    assert not list(tmp_path.iterdir())


# ---------------------------------------------------------------------- two recorders


def test_a_file_has_one_recorder(arm: o80.Frontend, path: Path) -> None:
    with o80.Recording(path, arm) as recording:
        arm.burst(10)
        recording.flush()
        with pytest.raises(o80.RecordingError, match="is being written by another recorder"):
            Recorder(path, [arm.segment], proceed=True)
        assert "is being written by another recorder" in refused("repair", path)
        arm.burst(10)

    assert o80.open(path)[arm.segment].epochs[0].history().iteration.tolist() == [*range(21)]


def test_a_forked_child_that_drops_its_copy_of_a_recording_says_nothing(
    arm: o80.Frontend, path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    held = [o80.Recording(path, arm.segment)]
    child = os.fork()
    if child == 0:
        held.clear()  # the last reference
        os._exit(0)
    os.waitpid(child, 0)
    held[0].close()

    assert capfd.readouterr().err == ""


def test_a_forked_child_does_not_keep_the_file_of_a_killed_recorder(
    arm: o80.Frontend, path: Path
) -> None:
    theirs, ours = os.pipe()
    told, tells = os.pipe()
    recorder_process = os.fork()
    if recorder_process == 0:
        recorder = Recorder(path, [arm.segment])
        recorder.poll()
        if os.fork() == 0:
            os.close(ours)
            os.write(tells, b".")
            os.read(theirs, 1)  # until the test has closed its end
            os._exit(0)
        signal.pause()
    try:
        os.read(told, 1)
        os.kill(recorder_process, signal.SIGKILL)
        os.waitpid(recorder_process, 0)
        opened(path, proceed=True).finish()
    finally:
        for end in (ours, theirs, told, tells):
            os.close(end)


def test_a_recording_that_is_open_when_its_program_ends_is_finished(
    path: Path, tmp_path: Path
) -> None:
    program = (
        "import o80\n"
        "arm = o80.robots.load('two_joints').inline()\n"
        f"recording = o80.Recording({str(tmp_path / 'run.mcap')!r}, arm)\n"
        "recording.mark('begin')\n"
        "arm.burst(40)\n"
    )
    run_python("-c", program)
    file = o80.open(path)
    (segment,) = file.segments.values()

    assert file.finished
    assert segment.epochs[0].rows == 41


def test_the_end_of_a_recording_does_not_wait_for_rows_published_after_it(
    arm: o80.Frontend, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(source, "LARGEST_BLOCK", 1)  # one row in a poll: never up to date
    recorder = Recorder(path, [arm.segment])
    arm.burst(10)
    polls = itertools.count()
    poll = recorder.poll

    def poll_while_the_robot_runs_on() -> int:
        assert next(polls) < 100
        arm.burst(1)
        return poll()

    monkeypatch.setattr(recorder, "poll", poll_while_the_robot_runs_on)
    recorder.catch_up()
    recorder.finish()

    assert recorder.rows >= 11


# ---------------------------------------------------------------------- marks


def test_marks_hold_numbers_and_arrays_of_numpy(arm: o80.Frontend, path: Path) -> None:
    with o80.Recording(path, arm) as recording:
        recording.mark("end", name="ball", hits=np.int64(3), target=np.zeros(2), won=np.True_)
        with pytest.raises(TypeError, match="that JSON can hold"):
            recording.mark("end", balls={1, 2})

    (mark,) = o80.open(path).marks
    assert mark.name == "end"
    assert mark.values == {"name": "ball", "hits": 3, "target": [0.0, 0.0], "won": True}


# ---------------------------------------------------------------------- damaged files


def test_a_length_beyond_all_memory_is_a_recording_error(arm: o80.Frontend, path: Path) -> None:
    with o80.Recording(path, arm):
        arm.burst(20)
    attachment = scan(path).attachments[0]
    texts = 8 + len(attachment.name) + len(attachment.media_type)
    damaged = bytearray(path.read_bytes())
    damaged[attachment.offset + HEAD.size + 16 + texts + 7] = 255  # of the size of its data
    path.write_bytes(damaged)
    with pytest.raises(o80.RecordingError, match=f"{path}: the record at byte .* is damaged"):
        _ = o80.open(path)[arm.segment].schema


# ---------------------------------------------------------------------- commands


def test_an_export_or_a_plot_that_cannot_be_written_is_refused(recorded: Path) -> None:
    folder = recorded.parent / "results"
    for name in ("rows.npz", "rows.h5", "rows.parquet"):
        with pytest.raises(o80.Error, match=f"{name} cannot be written: there is no folder"):
            export(str(recorded), folder / name)
    with pytest.raises(o80.Error, match="there is no folder"):
        plot([str(recorded)], folder / "run.png")
    for name in ("run", "run.xyz"):
        with pytest.raises(o80.Error, match=r"choose one of \.png, \.pdf, \.svg"):
            plot([str(recorded)], recorded.parent / name)


def test_a_sensor_without_actuators_is_recorded_plotted_and_exported(
    segment: str, path: Path, tmp_path: Path
) -> None:
    with o80.Backend(segment, extended={"force": float}, bursting=True) as sensor:
        sensor.publish(None, {"force": 1.5})
        o80.Recording(path, segment).close()
    history = o80.open(path)[segment].history()

    assert history.extended.force.tolist() == [1.5]
    assert "Name sensor values in fields" in refused("plot", path, "-o", tmp_path / "run.png")
    for words in (("plot", "--fields", "force", "-o", "run.png"), ("export", "-o", "run.npz")):
        run_o80(words[0], path, *words[1:], cwd=tmp_path)
    assert np.load(tmp_path / "run.npz")[f"{segment}/extended.force"].tolist() == [1.5]


def test_a_tolerance_is_a_number_from_0_on() -> None:
    for tolerance in ("observed", "observed=x", "observed=-1", "observed=nan"):
        with pytest.raises(typer.BadParameter, match="a number of at least 0"):
            diff("one", "other", tolerance=[tolerance])


def test_empty_recordings_are_not_called_equal(tmp_path: Path) -> None:
    path = tmp_path / "empty.mcap"
    Recorder(path, ["nobody"]).finish()

    with pytest.raises(o80.InvalidArgument, match="have no segment"):
        diff(str(path), str(path))
