"""The recordings below a folder: `o80.recordings` and `o80 recordings`."""

import json
import os
import shutil
import warnings
from datetime import datetime, timedelta
from pathlib import Path

import pytest

import o80
from o80.base.local_time import instant as time_of
from o80.cli.recordings import recordings as command

NAMES = ("a.mcap", "monday/b.mcap", "c.mcap")


@pytest.fixture
def folder(segment: str, tmp_path: Path) -> Path:
    """Three recordings: a file, one below with two runs and a mark, and a folder of files."""
    root = tmp_path / "lab"
    (root / "monday").mkdir(parents=True)
    load = o80.robots.load("two_joints").inline
    for path, split in zip(NAMES, (None, None, "1k"), strict=True):
        with o80.Recording(root / path, [segment], split=split) as recording:
            for _ in range(2 if path == "monday/b.mcap" else 1):
                with load(segment) as arm:
                    for _ in range(3):
                        arm.burst(20)
                        while recording._recorder.newest[segment] != arm.published:
                            recording.flush()
                        recording.flush()
                recording.flush()
                recording._recorder.sources[segment]._attempt_at = 0.0
            if path == "monday/b.mcap":
                recording.mark("Changed the battery", volts=24.5)
    return root


def names(found: list[o80.FoundRecording], folder: Path) -> list[str]:
    return [str(each.path.relative_to(folder)) for each in found]


def test_recordings_are_found_with_their_runs_and_marks(folder: Path, segment: str) -> None:
    found = o80.recordings(folder)
    assert names(found, folder) == ["a.mcap", "monday/b.mcap", "c.mcap"]  # the oldest first
    for each in found:
        opened = o80.open(each.path)
        assert (each.size, each.finished, each.problem) == (opened.size, True, "")
        assert {(run.segment, run.robot) for run in each.runs} == {(segment, "two_joints")}
        for run, epoch in zip(each.runs, opened[segment].epochs, strict=True):
            begin, end = (time + epoch.wall_offset for time in epoch.time_range)
            assert (run.begin, run.end, run.rows, run.missing) == (begin, end, epoch.rows, 0)
            assert run.ended == epoch.end
    assert [len(each.runs) for each in found] == [1, 2, 1]
    ((name, _, values),) = found[1].marks
    assert (name, json.loads(values)) == ("Changed the battery", {"volts": 24.5})
    assert names(o80.recordings(folder, text="BATTERY"), folder) == ["monday/b.mcap"]
    assert names(o80.recordings(folder, text="24.5"), folder) == ["monday/b.mcap"]
    assert len(o80.recordings(folder, text="two_jo")) == 3
    assert names(o80.recordings(folder, text="monday/"), folder) == ["monday/b.mcap"]
    b, c = (datetime.fromtimestamp(each.begin * 1e-9) for each in found[1:])
    assert names(o80.recordings(folder, end=b - timedelta(microseconds=2)), folder) == ["a.mcap"]
    assert names(o80.recordings(folder, begin=c), folder)[-1] == "c.mcap"
    assert o80.recordings(folder, begin=c + timedelta(days=1)) == []


def test_damaged_and_strange_files_are_listed_with_their_reason(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    content = (folder / "a.mcap").read_bytes()
    (folder / "cut.mcap").write_bytes(content[: len(content) // 2])
    (folder / "notes.mcap").write_text("no recording")
    (folder / "empty.mcap").write_bytes(b"")
    (folder / "nothing.mcap").mkdir()
    (folder / "gone.mcap").symlink_to("nowhere")
    flipped = bytearray(content)
    flipped[200 : len(content) // 2] = bytes(len(content) // 2 - 200)
    (folder / "flipped.mcap").write_bytes(flipped)
    found = {each.path.name: each for each in o80.recordings(folder)}
    assert not found["cut.mcap"].problem
    assert [run.ended for run in found["cut.mcap"].runs] == ["missing"]
    assert "is not an MCAP file" in found["notes.mcap"].problem
    assert found["empty.mcap"].problem
    assert "holds no recording" in found["nothing.mcap"].problem
    assert found["flipped.mcap"].problem
    assert "gone.mcap" not in found
    command(folder)
    said = capsys.readouterr().out
    assert "notes.mcap: not read: " in said
    assert "Changed" not in said
    assert " missing " in said


def test_links_pipes_and_names_of_any_bytes_are_no_obstacle(folder: Path, tmp_path: Path) -> None:
    (folder / "c.mcap").rename(tmp_path / "c.mcap")
    (folder / "c.mcap").symlink_to(tmp_path / "c.mcap")
    (folder / "circle").symlink_to(folder)
    os.mkfifo(folder / "pipe.mcap")
    strange = folder / os.fsdecode(b"\xff.mcap")
    shutil.copy(folder / "a.mcap", strange)
    found = o80.recordings(folder)
    assert found == o80.recordings(folder)
    assert {each.path for each in found} == {strange, *map(folder.joinpath, NAMES)}
    assert found[-1].size == sum(file.stat().st_size for file in folder.glob("c.mcap/*"))
    strange.unlink()
    min(folder.glob("c.mcap/*")).unlink()  # the link is as it was
    fewer = o80.recordings(folder)
    assert [each.path.name for each in fewer] == ["a.mcap", "b.mcap", "c.mcap"]
    assert fewer[-1].runs[0].rows < found[-1].runs[0].rows


def test_the_command_lists_filters_and_gives_json(
    folder: Path, segment: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        command(folder)
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[1:]] == ["a.mcap", "monday/b.mcap", segment, "c.mcap"]
    assert all(" stopped" in line for line in lines[1:])
    command(folder, text="battery", as_json=True)
    (only,) = json.loads(capsys.readouterr().out)
    assert only["path"] == str(folder / "monday" / "b.mcap")
    assert only["marks"][0]["name"] == "Changed the battery"
    today = f"{datetime.now():%Y-%m-%d}"
    command(folder, begin="2020-01-01", end="2020-12-31")
    assert "no recording in" in capsys.readouterr().out
    assert time_of(today, is_end=True) - time_of(today) == timedelta(days=1, microseconds=-1)
    assert time_of("9:05") == time_of(f"{today} 09:05")
    assert time_of(f"{today} 10", is_end=True) == time_of("10:00")
    with pytest.raises(o80.RecordingError, match=r"`o80 recordings .*` lists them"):
        o80.open(folder)
    assert len(o80.recordings(folder, begin=datetime.min, end=datetime.max)) == len(lines) - 2
    for wrong in ("noon", "10:2"):
        with pytest.raises(o80.InvalidArgument, match=f"2026-11-24.* not '{wrong}'"):
            command(folder, begin=wrong)
    for path in (folder / "a.mcap", folder / "c.mcap", folder / "nowhere"):
        with pytest.raises(o80.InvalidArgument, match="is not a folder of recordings"):
            o80.recordings(path)
