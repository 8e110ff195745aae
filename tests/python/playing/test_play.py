"""Recordings that are played: what readers see, in time and by bursts, and what is refused."""

import contextlib
import math
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from processes import O80, WAIT, Running, o80_says

import o80
from o80.difference import first_difference


@pytest.fixture
def real_time(segment: str, tmp_path: Path) -> Path:
    """Rows of an arm in real time, 1000 a second."""
    path = tmp_path / "real.mcap"
    with o80.robots.load("two_joints").start(segment) as process:
        arm = process.frontend()
        with o80.Recording(path, arm):
            arm.add_command("elbow", 0.5, duration=0.1)
            arm.pulse()
            arm.wait_for(arm.published + 300)
    return path


def rows_of(path: Path, segment: str, epoch: int = 0) -> o80.History:
    return o80.open(path)[segment].epochs[epoch].history()


def read_to_the_end(segment: str) -> list[int]:
    """A user's script: it does not know whether a robot runs or a recording is played."""
    iterations: list[int] = []
    with o80.Frontend(segment, WAIT) as arm, contextlib.suppress(o80.BackendStopped):
        iterations.extend(each.iteration for each in arm.stream(since=0))
    return iterations


def test_a_script_reads_a_robot_and_its_recording_alike(real_time: Path, segment: str) -> None:
    expected = rows_of(real_time, segment).iteration.tolist()
    found: list[list[int]] = []
    reader = threading.Thread(target=lambda: found.append(read_to_the_end(segment)))
    with o80.play(real_time) as playback:
        reader.start()
        assert playback.wait(WAIT)
        reader.join(WAIT)
    assert found == [expected]


def test_at_recorded_speed_times_are_those_of_now(real_time: Path, segment: str) -> None:
    recorded = rows_of(real_time, segment)
    begin = time.monotonic_ns()
    with o80.play(real_time, hold=True) as playback, o80.Frontend(segment, WAIT) as arm:
        assert playback.wait(WAIT)
        end = time.monotonic_ns()
        played = arm.history()
        assert arm.schema["clock"] == "monotonic"
        age = arm.row_age
        assert age is not None
        assert age * 1e9 < time.monotonic_ns() - begin
    shift = played.time - recorded.time
    assert (shift == shift[0]).all()
    assert begin <= played.time[0]
    assert played.time[-1] <= end
    assert first_difference(played, recorded) is None
    played.rows["time"] = recorded.time
    assert played.rows.tobytes() == recorded.rows.tobytes()  # the padding too


@pytest.mark.parametrize("speed", [10.0, math.inf])
def test_at_another_speed_rows_are_exactly_as_recorded(
    real_time: Path, segment: str, speed: float
) -> None:
    recorded = rows_of(real_time, segment)
    begin = time.monotonic()
    with o80.play(real_time, speed=speed, end=math.inf, hold=True) as playback:
        assert playback.wait(WAIT)
        taken = time.monotonic() - begin
        with o80.Frontend(segment) as arm:
            assert arm.history().rows.tobytes() == recorded.rows.tobytes()
            assert (arm.played, arm.robot, arm.row_age) == (True, "two_joints", None)
            assert arm.schema["clock"] == "simulated"
            assert arm.provenance == o80.open(real_time)[segment].epochs[0].provenance
        assert playback.rows == len(recorded)
    seconds = float(recorded.time[-1] - recorded.time[0]) * 1e-9
    assert taken >= (0 if math.isinf(speed) else seconds / speed)
    assert segment not in [each.name for each in o80.segments()]


def test_a_part_is_played(recorded: Path, segment: str) -> None:
    with o80.play(recorded, speed=math.inf, begin=0.05, end=0.1) as playback:
        assert playback.wait(WAIT)
        with o80.Frontend(segment) as arm:
            assert arm.history().iteration.tolist() == list(range(50, 101))
            with pytest.raises(o80.RowOverwritten):
                arm.wait_for(49)
    with pytest.raises(o80.InvalidArgument, match="no row in the requested part"):
        o80.play(recorded, begin=1000.0)


def test_restarts_are_played_as_restarts(segment: str, path: Path, tmp_path: Path) -> None:
    with o80.Recording(path, segment) as recording:
        for count in (30, 20):
            with o80.robots.load("two_joints").inline(segment) as arm:
                arm.burst(count)
                while recording.rows < (31 if count == 30 else 52):
                    recording.flush()
    copy = tmp_path / "copy.mcap"
    with o80.Recording(copy, segment) as recording, o80.play(path, bursts=True, history=100):
        for count in (30, 20):
            with o80.Frontend(segment, WAIT) as arm:
                assert arm.burst(count).iteration == count
                while recording.rows < (31 if count == 30 else 52):
                    recording.flush()
                with pytest.raises(o80.BackendStopped):
                    arm.burst(1, timeout=WAIT)
    for epoch in (0, 1):
        one, other = rows_of(path, segment, epoch), rows_of(copy, segment, epoch)
        assert one.rows.tobytes() == other.rows.tobytes()


def test_loop_begins_again_as_a_restart(recorded: Path, segment: str) -> None:
    with o80.play(recorded, bursts=True, loop=True):
        epochs = set()
        for _ in range(3):
            with o80.Frontend(segment, WAIT) as arm:
                epochs.add(arm.epoch)
                assert arm.burst(200).iteration == 200
                with pytest.raises(o80.BackendGone):
                    arm.burst(1, timeout=WAIT)
        assert len(epochs) == 3


def test_a_living_robot_keeps_its_name(recorded: Path, segment: str) -> None:
    with o80.robots.load("two_joints").inline(segment):
        with pytest.raises(o80.SegmentTaken, match="--prefix"):
            o80.play(recorded)
        with o80.play(recorded, speed=math.inf, prefix="old-") as playback:
            assert playback.names == [f"old-{segment}"]
            assert playback.wait(WAIT)
        with o80.play(recorded, names={segment: f"{segment}-b"}) as playback:
            assert playback.names == [f"{segment}-b"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"speed": 0.0}, "speed must be positive"),
        ({"begin": -1.0}, "begin must be a number of seconds from 0"),
        ({"begin": 1e308}, "begin must be a number of seconds from 0"),
        ({"begin": 10.0, "end": math.inf}, "has no row in the requested part"),
        ({"begin": 2.0, "end": 1.0}, "end must be later than begin"),
        ({"history": 0}, "history"),
        ({"history": 2**63}, "history must be less than"),
        ({"segments": "aram"}, "no segment 'aram'"),
    ],
)
def test_mistakes_are_named(recorded: Path, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(o80.InvalidArgument, match=message):
        o80.play(recorded, **arguments)


def test_the_journal_is_played(recorded: Path, segment: str) -> None:
    expected = o80.open(recorded)[segment].epochs[0].journal()
    with o80.play(recorded, bursts=True), o80.Frontend(segment, WAIT) as arm:
        arm.burst(10)
        so_far = arm.journal()
        assert repr(so_far) == repr(expected[: len(so_far)])
        assert all(entry.iteration <= 10 for entry in so_far)
        assert any(entry.commands for entry in so_far)
        arm.burst(190)
        assert repr(arm.journal()) == repr(expected[: len(arm.journal())])
        assert any(entry.status is o80.Status.COMPLETED for entry in arm.journal())


def test_a_fault_of_the_recorded_robot_is_raised_again(segment: str, path: Path) -> None:
    with o80.Recording(path, segment) as recording:

        def break_down() -> None:
            with o80.Backend(segment, ["joint"]) as backend:
                backend.publish([0.0])
                while not recording.rows:
                    recording.flush()
                raise RuntimeError("the belt broke")

        with pytest.raises(RuntimeError):
            break_down()
    o80.clean(segment)
    with (
        o80.play(path, bursts=True),
        o80.Frontend(segment, WAIT) as arm,
        pytest.raises(o80.BackendFailed, match="the belt broke"),
    ):
        arm.burst(1, timeout=WAIT)
    assert segment not in [each.name for each in o80.segments()]


# ----------------------------------------------------------------------------------------- o80 play


@contextmanager
def playing(*words: str | Path) -> Iterator[None]:
    """o80 play, which Ctrl-C ends in order."""
    with Running(O80, "play", *words) as player:
        yield
        player.send_signal(signal.SIGINT)
        _, said = player.communicate(timeout=WAIT)
        assert player.returncode == 0, said


def test_other_commands_see_the_rows(recorded: Path, segment: str, tmp_path: Path) -> None:
    copy = tmp_path / "copy.mcap"
    with playing(recorded, "--fast"):
        with o80.Frontend(segment, WAIT) as arm:
            arm.wait_for(200, timeout=WAIT)
        assert "played" in o80_says("list")
        assert " 200 " in o80_says("echo", segment, "--count", "1")
        said = o80_says("info", segment)
        assert "a recording of 1000 Hz is played" in said
        assert "robot two_joints, played, rows" in said
        assert "is a recording that is being played" in o80_says("halt", segment, code=1)
        o80_says("save", segment, "-o", copy)
        o80_says("plot", segment, "-o", tmp_path / "run.png")
    o80_says("diff", recorded, copy)
    assert segment not in o80_says("list")


def test_it_ends_with_the_last_row(recorded: Path) -> None:
    said = o80_says("play", recorded, "--speed", "2")
    assert "playing 0.1 s" in said or "playing 0.2 s" in said
    assert "201 rows" in said


def test_bursts_are_served(recorded: Path, segment: str) -> None:
    with playing(recorded, "--bursts"), o80.Frontend(segment, WAIT) as arm:
        assert arm.burst(20).iteration == 20


def test_a_name_that_is_taken_is_refused(recorded: Path, segment: str) -> None:
    with o80.robots.load("two_joints").inline(segment):
        assert "--prefix" in o80_says("play", recorded, code=1)
        o80_says("play", recorded, "--speed", "100", "--name", f"{segment}-b")


def test_contradictory_options_are_refused_by_their_names(recorded: Path) -> None:
    assert "--fast" in (said := o80_says("play", recorded, "--fast", "--speed", "2", code=2))
    assert "--speed 2" in said
    said = " ".join(o80_says("play", recorded, "--from", "5", "--to", "2", code=2).split())
    assert "--to" in said
    assert "--from (5 s)" in said
    assert "--from" in o80_says("play", recorded, "--from", "-1", code=2)


def test_a_name_that_is_no_file_is_told_how_to_become_one(tmp_path: Path) -> None:
    said = o80_says("play", "arm", code=1)
    assert "there is no file arm" in said
    assert "o80 record arm -o arm.mcap" in said
    said = o80_says("export", "arm", "--format", "lerobot", "-o", tmp_path / "set", code=1)
    assert "o80 record arm -o arm.mcap" in said
