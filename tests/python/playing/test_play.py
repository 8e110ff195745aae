"""Recordings that are played: what readers see, in time and by bursts, and what is refused."""

import contextlib
import math
import threading
import time
from pathlib import Path
from typing import Any

import pytest
from processes import WAIT

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


def test_rows_appear_again_bit_for_bit(recorded: Path, segment: str) -> None:
    with o80.play(recorded, speed=math.inf) as playback:
        assert playback.wait(WAIT)
        with o80.Frontend(segment) as arm:
            assert arm.played
            assert arm.robot == "two_joints"
            assert arm.provenance == o80.open(recorded)[segment].epochs[0].provenance
            assert arm.history().rows.tobytes() == rows_of(recorded, segment).rows.tobytes()
        assert playback.rows == 201
    assert segment not in [each.name for each in o80.segments()]


def test_a_script_reads_a_robot_and_its_recording_alike(real_time: Path, segment: str) -> None:
    expected = rows_of(real_time, segment).iteration.tolist()
    found: list[list[int]] = []
    reader = threading.Thread(target=lambda: found.append(read_to_the_end(segment)))
    with o80.play(real_time, history=1000) as playback:
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
    with o80.play(real_time, speed=speed, hold=True) as playback:
        assert playback.wait(WAIT)
        taken = time.monotonic() - begin
        with o80.Frontend(segment) as arm:
            assert arm.history().rows.tobytes() == recorded.rows.tobytes()
            assert arm.schema["clock"] == "simulated"
            assert arm.row_age is None
    seconds = float(recorded.time[-1] - recorded.time[0]) * 1e-9
    assert taken >= (0 if math.isinf(speed) else seconds / speed)


def test_a_part_is_played(recorded: Path, segment: str) -> None:
    with o80.play(recorded, speed=math.inf, begin=0.05, end=0.1) as playback:
        assert playback.wait(WAIT)
        with o80.Frontend(segment) as arm:
            assert arm.history().iteration.tolist() == list(range(50, 101))
            with pytest.raises(o80.RowOverwritten):
                arm.wait_for(49)
    with pytest.raises(o80.InvalidArgument, match="no row in the requested part"):
        o80.play(recorded, begin=1000.0)


def test_restarts_are_played_as_restarts(segment: str, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
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


def test_gaps_are_played_as_gaps(segment: str, tmp_path: Path) -> None:
    path, copy = tmp_path / "run.mcap", tmp_path / "copy.mcap"
    with (
        o80.robots.load("two_joints").inline(segment, history=20) as arm,
        o80.Recording(path, arm) as recording,
    ):
        recording.flush()
        with recording._lock:  # the recorder is late
            arm.burst(100)
    last = o80.open(path)[segment].epochs[0].gaps[-1].last
    assert last is not None
    with o80.play(path, speed=math.inf, history=20) as playback:
        assert playback.wait(WAIT)
        with o80.Recording(copy, segment):
            pass
    again = rows_of(copy, segment)
    assert again.iteration[0] == last + 1
    assert again.rows.tobytes() == rows_of(path, segment).select(since=last + 1).rows.tobytes()


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
        ({"begin": 2.0, "end": 1.0}, "end must be later than begin"),
        ({"history": 0}, "history"),
        ({"segments": "aram"}, "no segment 'aram'"),
    ],
)
def test_mistakes_are_named(recorded: Path, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(o80.InvalidArgument, match=message):
        o80.play(recorded, **arguments)


def decisions(journal: list[o80.JournalEntry]) -> list[str]:
    return [str(entry) for entry in journal]


def test_the_journal_is_played(recorded: Path, segment: str) -> None:
    expected = o80.open(recorded)[segment].epochs[0].journal()
    with o80.play(recorded, bursts=True), o80.Frontend(segment, WAIT) as arm:
        arm.burst(10)
        so_far = arm.journal()
        assert decisions(so_far) == decisions(expected)[: len(so_far)]
        assert all(entry.iteration <= 10 for entry in so_far)
        assert any(entry.commands for entry in so_far)
        arm.burst(190)
        assert decisions(arm.journal()) == decisions(expected)[: len(arm.journal())]
        assert any(entry.status is o80.Status.COMPLETED for entry in arm.journal())


def test_a_fault_of_the_recorded_robot_is_raised_again(segment: str, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
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
