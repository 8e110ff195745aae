"""o80 record, o80 save and o80 repair."""

import json
import signal
from pathlib import Path

import pytest
from processes import O80, WAIT, Running, o80_says

import o80
from o80.recording.scan import scan


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_finishes_the_file(
    number: signal.Signals, process: o80.robots.Process, path: Path
) -> None:
    with Running(O80, "record", process.segment, "-o", path) as recorder:
        while not path.exists() or not scan_or_none(path):
            assert recorder.poll() is None
        recorder.send_signal(number)
        _, said = recorder.communicate(timeout=WAIT)

    assert recorder.returncode == 0, said
    file = o80.open(path)
    assert file.finished
    assert f"{file[process.segment].epochs[0].rows} rows" in said


def scan_or_none(path: Path) -> bool:
    """Whether a chunk is in the file."""
    try:
        return bool(scan(path).chunks)
    except ValueError:
        return False


def test_seconds_and_size_end_it(process: o80.robots.Process, tmp_path: Path) -> None:
    o80_says("record", process.segment, "-o", tmp_path / "a.mcap", "--seconds", "0.2")
    o80_says("record", process.segment, "-o", tmp_path / "b.mcap", "--size", "3k")

    for name in ("a", "b"):
        assert o80.open(tmp_path / f"{name}.mcap")[process.segment].epochs[0].rows > 0
    assert scan(tmp_path / "b.mcap").end >= 3000


def recorded(segment: str, path: Path, *words: str) -> str:
    """First line of `o80 record` about one segment."""
    said = o80_says("record", segment, "-o", path, "--seconds", "0.1", *words)
    return next(line for line in said.splitlines() if f"'{segment}' " in line)


def test_a_robot_that_runs_is_recorded_from_row_0_and_replays(
    process: o80.robots.Process, path: Path, tmp_path: Path
) -> None:
    with o80.Frontend(process.segment) as arm:
        arm.wait_for(300, WAIT)
    said = recorded(process.segment, path)
    assert said.endswith("is recorded from row 0: the recording can be replayed")
    report = o80.replay(path)
    assert report.identical, report
    assert report.runs[0].rows > 300
    from_now = recorded(process.segment, tmp_path / "now.mcap", "--from-now")
    assert "(--from-now): a replay begins at the next reset, restored snapshot or snap" in from_now
    first = int(o80.open(tmp_path / "now.mcap")[process.segment].history().iteration[0])
    assert first > 300
    assert f"is recorded from row {first} " in from_now


def test_a_recording_that_cannot_be_replayed_says_why(segment: str, tmp_path: Path) -> None:
    joints = o80.robots.load("two_joints")
    with joints.inline(segment, history=1000) as arm:
        arm.burst(5000)
        said = recorded(segment, tmp_path / "late.mcap")
        first = int(o80.open(tmp_path / "late.mcap")[segment].history().iteration[0])
        assert f"is recorded from row {first}, because earlier ones were overwritten" in said
    with joints.inline(segment, journal=0):
        said = recorded(segment, tmp_path / "mute.mcap")
        assert said.endswith("cannot be replayed: it was started without a journal")
    with o80.Backend(segment, actuators=["knee"]) as backend:
        backend.publish([0.0])
        said = recorded(segment, tmp_path / "world.mcap", "--snapshots", "1")
        assert said == f"o80: no snapshot is recorded: '{segment}' serves no request snapshot"
        said = recorded(segment, tmp_path / "alone.mcap")
        assert said.endswith("the recording can be replayed without its driver")


def test_a_recorder_that_continues_says_where_it_goes_on(arm: o80.Frontend, path: Path) -> None:
    with o80.Recording(path, arm, split="1k") as recording:
        for _ in range(3):
            arm.burst(20)
            recording.flush()
    said = recorded(arm.segment, path, "--split", "1k", "--continue")
    assert f"'{arm.segment}' continues with row 61; `o80 info` lists" in said


@pytest.mark.parametrize(
    ("words", "said", "code"),
    [
        (["--seconds", "-1"], "must be a positive number", 2),
        (["--seconds", "nan"], "must be a positive number", 2),
        (["--size", "many"], "size must be a size such as 50G", 1),
        (["--size", "0"], "size must be a size such as 50G", 1),
    ],
)
def test_wrong_options_are_named(words: list[str], said: str, code: int, tmp_path: Path) -> None:
    printed = o80_says("record", "arm", "-o", tmp_path / "a.mcap", *words, code=code)
    assert said in " ".join(printed.split())
    assert not (tmp_path / "a.mcap").exists()


def test_a_segment_that_is_not_there_is_waited_for_and_said(tmp_path: Path) -> None:
    said = o80_says("record", "nobody", "-o", tmp_path / "a.mcap", "--seconds", "0.7")

    assert "waiting for segment 'nobody'" in said
    assert "0 rows" in said
    assert "nothing of 'nobody' was recorded" in said


def test_info_describes_a_recording(path: Path) -> None:
    for gain in (13.0, 13.0, 15.0):
        with (
            o80.robots.load("two_joints").inline("arm", gain=gain) as arm,
            o80.Recording(path, arm, proceed=path.exists()) as recording,
        ):
            recording.mark("episode", gain=gain, targets=[0.25] * 40)
            arm.burst(100)

    said = o80_says("info", path)
    assert f"{path}: 1 segment, " in said
    assert said.count("two_joints  20") == 3  # a row of the table for each run, with its date
    assert "arm, runs 0, 1: started with" in said
    assert "arm, run 2: started with" in said
    assert "gain=15" in said
    marks = said[said.index("3 marks") :].splitlines()[1:4]
    assert [mark.split()[1:3] for mark in marks] == [
        ["episode", f"gain={gain},"] for gain in (13.0, 13.0, 15.0)
    ]
    assert all(mark.endswith("...") for mark in marks)  # that a value goes on is said
    told = json.loads(o80_says("info", path, "--json"))
    assert [each["rows"] for each in told] == [each.rows for each in o80.open(path)["arm"].epochs]
