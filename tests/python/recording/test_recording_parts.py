"""Recordings made of others: `o80 cut` and `o80 merge`."""

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from published_rows import messages_of
from rosbags.highlevel import AnyReader

import o80
from o80.cli.cut import cut, merge
from o80.recording.epoch import Gap, topic_of
from o80.recording.marks import Mark

HOUR = 3600 * 10**9  # [ns]


@pytest.fixture
def day(segment: str, tmp_path: Path) -> Path:
    """Two robots, 3 s; the first at rest in the middle, with a mark each second."""
    path = tmp_path / "day.mcap"
    load = o80.robots.load("two_joints").inline
    with load(segment) as arm, load(f"{segment}-b") as other:
        recording = o80.Recording(path, [arm, other])
        for second in range(3):
            recording.mark("second", number=second)
            for robot in (arm, other):
                robot.add_command("elbow", 0.1 * second, iterations=100)
                robot.burst(500)
            recording.flush()
            for robot in (arm, other):
                robot.burst(500)
            recording.flush()
    recording.close()
    return path


def log_time(recording: o80.RecordingFile, mark: Mark) -> int:
    """The log time of the newest row when a mark was made [ns]."""
    epochs = {name: recording[name].epochs[0] for name in mark.rows}
    return max(
        int(epochs[name].history(since=row, until=row).time[0]) + epochs[name].wall_offset
        for name, row in mark.rows.items()
    )


def test_a_stretch_of_time_is_cut_and_replayed(day: Path, segment: str, tmp_path: Path) -> None:
    part = tmp_path / "part.mcap"
    cut(day, part, "0.7", "2.6")
    whole, read = o80.open(day), o80.open(part)
    first = whole.time_range[0]
    for name in whole:
        epoch = whole[name].epochs[0]
        begin, end = (first + round(s * 1e9) - epoch.wall_offset for s in (0.7, 2.6))
        expected = epoch.history(from_time=begin, to_time=end)
        assert read[name].history().rows.tobytes() == expected.rows.tobytes()
        assert read[name].schema == whole[name].schema
        assert read[name].epochs[0].first_row == expected.iteration[0]
        assert read[name].epochs[0].gaps == [Gap(0, expected.iteration[0] - 1, "cut away")]
        assert read[name].epochs[0].provenance == epoch.provenance
    begin, end = (first + round(s * 1e9) for s in (0.7, 2.6))
    assert [mark.row_time for mark in whole.marks] == [log_time(whole, m) for m in whole.marks]
    numbers = [m.values["number"] for m in whole.marks if begin <= log_time(whole, m) <= end]
    assert [mark.values["number"] for mark in read.marks] == numbers
    assert 1 in numbers
    report = o80.replay(part, driver=False)
    assert report.difference is None
    assert all(run.rows > 1000 for run in report), report
    with AnyReader([part]) as reader:
        topics = [each.topic for each, _, _ in reader.messages()]
    assert topics.count(topic_of(segment)) == topics.count(topic_of(segment, "joint_states"))


@pytest.mark.parametrize(("every", "ranges"), [(7, [(1, 2996), (2997, 3000)]), (5000, [(1, 3000)])])
def test_segments_are_chosen_and_rows_are_thinned(
    day: Path, segment: str, tmp_path: Path, every: int, ranges: list[tuple[int, int]]
) -> None:
    part = tmp_path / "part.mcap"
    cut(day, part, segment=[segment], every=every)
    read = o80.open(part)
    assert [*read] == [segment]
    (epoch,) = read[segment].epochs
    assert epoch.history().iteration.tolist() == [*range(0, 3001, every)]
    assert epoch.gaps == [Gap(*each, f"every {every}th row was kept") for each in ranges]
    assert epoch.missing == 3001 - epoch.rows
    assert len(epoch.journal()) == len(o80.open(day)[segment].epochs[0].journal())
    report = o80.replay(part)
    assert not report.identical
    assert "missing" in str(report)
    with pytest.raises(o80.InvalidArgument, match=segment):
        cut(day, tmp_path / "other.mcap", segment=["leg"])


def test_parts_that_overlap_are_merged_to_the_whole(day: Path, tmp_path: Path) -> None:
    parts = [tmp_path / f"{i}.mcap" for i in range(3)]
    for i, part in enumerate(parts):
        cut(day, part, f"{i - 0.2}" if i else "", f"{i + 1.1}" if i < 2 else "")
    merged = tmp_path / "merged.mcap"
    merge([parts[1], parts[2], parts[0]], merged)
    whole, read = o80.open(day), o80.open(merged)
    for name in whole:
        assert len(read[name].epochs) == 1
        assert read[name].history().rows.tobytes() == whole[name].history().rows.tobytes()
        assert repr(read[name].epochs[0].journal()) == repr(whole[name].epochs[0].journal())
    assert read.marks == whole.marks
    assert o80.replay(merged).identical


def test_runs_of_several_recordings_are_numbered_anew(segment: str, tmp_path: Path) -> None:
    paths = [tmp_path / f"{i}.mcap" for i in range(2)]
    robots = o80.robots.load("two_joints"), o80.robots.load("two_joints")
    for i, (robot, path) in enumerate(zip(robots, paths, strict=True)):
        with robot.inline(segment) as arm, o80.Recording(path, arm):
            arm.burst(100 * (i + 1))
    merged = tmp_path / "merged.mcap"
    merge(paths[::-1], merged)
    epochs = o80.open(merged)[segment].epochs
    assert [epoch.rows for epoch in epochs] == [101, 201]
    assert np.array_equal(epochs[1].history().iteration, np.arange(201))
    assert all(run.identical for run in o80.replay(merged))


def test_a_stretch_without_rows_says_so(
    day: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cut(day, tmp_path / "none.mcap", "100", "200")
    assert "no row" in capsys.readouterr().out
    with pytest.raises(o80.InvalidArgument, match="--from must be before --to"):
        cut(day, tmp_path / "other.mcap", "2", "1")
    with pytest.raises(o80.InvalidArgument, match=r"--from 100 is after the end: .* s$"):
        cut(day, tmp_path / "other.mcap", "100")
    with pytest.raises(o80.InvalidArgument, match=r"--to: write 10:02.* not '1e308'"):
        cut(day, tmp_path / "other.mcap", "0", "1e308")
    with pytest.raises(o80.RecordingError, match="exists"):
        cut(day, day, "0", "1")


def test_poses_of_bodies_are_added_as_transforms(arm: o80.Frontend, tmp_path: Path) -> None:
    path, shown, segment = tmp_path / "run.mcap", tmp_path / "shown.mcap", arm.segment
    with o80.Recording(path, arm):
        arm.add_command(["shoulder", "elbow"], [0.5, -1.0], iterations=900)
        arm.burst(1000)
    cut(path, shown, transforms=60.0)
    (epoch,) = o80.open(shown)[segment].epochs
    rows = epoch.history()
    assert rows.rows.tobytes() == o80.open(path)[segment].history().rows.tobytes()
    model = mujoco.MjModel.from_xml_string(epoch.model)
    data = mujoco.MjData(model)
    bodies = [model.body(number).name for number in range(1, model.nbody)]
    found = messages_of(shown, "/tf")
    seconds = (rows.time[-1] - rows.time[0]) * 1e-9
    assert abs(len(found) - 60 * seconds) <= 2
    for time, message in found:
        row = rows.at_time(time - epoch.wall_offset)
        for name, angle in zip(("shoulder", "elbow"), row.observed, strict=True):
            data.joint(name).qpos = angle
        mujoco.mj_kinematics(model, data)
        names = [each.child_frame_id for each in message.transforms]
        assert names == [f"{segment}/{body}" for body in bodies]
        for each, body in zip(message.transforms, bodies, strict=True):
            stamp = each.header.stamp
            assert stamp.sec * 10**9 + stamp.nanosec == time
            assert each.header.frame_id == "world"
            at, turn = each.transform.translation, each.transform.rotation
            assert (at.x, at.y, at.z) == tuple(data.body(body).xpos)
            assert (turn.w, turn.x, turn.y, turn.z) == tuple(data.body(body).xquat)
    again = tmp_path / "again.mcap"
    cut(shown, again, transforms=10.0)
    assert abs(len(messages_of(again, "/tf")) - 10 * seconds) <= 2
    cut(shown, tmp_path / "kept.mcap")
    assert len(messages_of(tmp_path / "kept.mcap", "/tf")) == len(found)


def test_a_robot_without_a_model_gets_no_transforms(
    segment: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for model in ("", "<mujoco><nothing/></mujoco>"):
        path, shown = tmp_path / f"run{bool(model)}.mcap", tmp_path / f"shown{bool(model)}.mcap"
        given: dict[str, Any] = {"model": model, "joints": {"elbow": "a"}} if model else {}
        with o80.Backend(segment, ["a"], **given) as backend:
            backend.publish([0.0])
            o80.Recording(path, segment).close()
        cut(path, shown, transforms=60.0)
        assert messages_of(shown, "/tf") == []
        complained = f"no transforms of '{segment}': the model" in capsys.readouterr().err
        assert complained == bool(model)


def test_robots_keep_their_distances_if_the_wall_clock_is_set_between_their_starts(
    segment: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = [segment, f"{segment}-b"]
    both, alone, later = (tmp_path / f"{name}.mcap" for name in ("both", "alone", "later"))
    known: Any = o80.Frontend.provenance

    def stepped(frontend: o80.Frontend) -> o80.Provenance:
        told: o80.Provenance = known.fget(frontend)
        later = HOUR * names.index(frontend.segment)
        return replace(told, wall_clock_offset=told.wall_clock_offset + later)

    monkeypatch.setattr(o80.Frontend, "provenance", property(stepped))
    with ExitStack() as stack:
        backends = [o80.Backend(name, ["a"], units={"State": "rad"}) for name in names]

        def iterate() -> None:
            for backend in backends * 50:
                backend.step()
                backend.publish([0.0])

        for backend in backends:
            stack.enter_context(backend).publish([0.0])
        arm, other = (stack.enter_context(o80.Frontend(name)) for name in names)
        with o80.Recording(alone, [other]), o80.Recording(both, [arm, other]):
            iterate()
        aligned = o80.align([arm, other], by=arm.segment)
        iterate()
        o80.Recording(later, [other]).close()
    assert aligned[names[1]].found[-1]
    apart = [o80.open(path)[names[1]].epochs[0].wall_offset for path in (both, alone)]
    assert apart[1] - apart[0] > HOUR / 2  # by the wall clocks of their starts
    cut(both, tmp_path / "part.mcap", "0", "1000")
    merge([later, both, alone], tmp_path / "merged.mcap")
    for name in ("part.mcap", "merged.mcap"):
        read = o80.open(tmp_path / name)
        offsets = {read[each].epochs[0].wall_offset for each in names}
        assert len(offsets) == 1, name
        begin, end = read.time_range
        assert end - begin < HOUR / 2
        for each in names:
            assert read[each].epochs[0].rows >= o80.open(both)[each].epochs[0].rows
    with AnyReader([tmp_path / "merged.mcap"]) as reader:
        for connection, at, raw in reader.messages():
            if connection.topic.endswith("joint_states"):
                states: Any = reader.deserialize(raw, connection.msgtype)
                stamp = states.header.stamp
                assert stamp.sec * 10**9 + stamp.nanosec == at
