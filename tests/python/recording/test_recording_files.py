"""Files of recordings: what public readers see, and what is left of cut and damaged ones."""

import re
import resource
import shutil
import subprocess
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer
from published_rows import messages_of
from rosbags.highlevel import AnyReader

import o80
from o80.base import progress
from o80.cli.cut import cut
from o80.recording.epoch import topic_of
from o80.recording.file_writer import FileWriter, Form
from o80.recording.reader import files_of
from o80.recording.recorder import Recorder
from o80.recording.scan import scan
from o80.rows.journal import command_ends

CUTS = 30


@pytest.fixture
def recorded(
    arm: o80.Frontend, path: Path, monkeypatch: pytest.MonkeyPatch
) -> tuple[Path, o80.History]:
    """A file of 10 chunks of 20 rows, each before one of their joint states, and the rows."""
    monkeypatch.setattr("o80.recording.file_writer.LARGE", 0)
    recorder = Recorder(path, [arm.segment])
    for i in range(10):
        arm.add_command("elbow", 0.1 * i, iterations=20)
        arm.burst(20)
        recorder.poll()
    recorder.finish()
    return path, arm.history()


@pytest.mark.parametrize("moved", [True, False])
def test_a_file_that_loses_its_name_while_it_is_written_is_not_lost(
    arm: o80.Frontend, path: Path, moved: bool
) -> None:
    other = path.with_name("moved.mcap")
    recorder = Recorder(path, [arm.segment])
    arm.burst(20)
    recorder.poll()
    if moved:
        path.rename(other)
    else:
        path.unlink()
    arm.burst(20)
    said = "moved.mcap, and continues" if moved else "written again"
    with pytest.warns(RuntimeWarning, match=said):
        recorder.poll()
    arm.burst(20)
    recorder.poll()  # says it once
    recorder.finish()
    assert path.exists() is not moved
    assert len(o80.open(other if moved else path)[arm.segment].history()) == 61


def rows_in(path: Path, arm: o80.Frontend) -> int:
    """Rows that a public reader finds."""
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        return sum(1 for _ in reader.iter_messages([topic_of(arm.segment)]))


def test_joint_states_may_be_left_out(arm: o80.Frontend, path: Path) -> None:
    with o80.Recording(path, arm, joint_states=False):
        arm.add_command("elbow", 0.5, iterations=20)
        arm.burst(50)
    assert rows_in(path, arm) == 51
    with AnyReader([path]) as reader:
        assert topic_of(arm.segment, "joint_states") not in reader.topics
    assert o80.open(path)[arm.segment].history().rows.tobytes() == arm.history().rows.tobytes()


def copied(
    path: Path, source: Path, *, topics: str = "", others: bool = True, **setting: Any
) -> None:
    """As a tool copies a file: all that the mcap library reads, through its writer."""
    with path.open("wb") as out, source.open("rb") as file:
        writer, reader = Writer(out, chunk_size=20_000, **setting), make_reader(file)
        writer.start(profile="ros2", library="a tool")
        known: dict[int, int] = {}
        for schema, channel, each in reader.iter_messages():
            assert schema is not None
            if re.search(topics, channel.topic):
                if channel.id not in known:
                    number = writer.register_schema(schema.name, schema.encoding, schema.data)
                    how = channel.message_encoding, number, channel.metadata
                    known[channel.id] = writer.register_channel(channel.topic, *how)
                times = {"log_time": each.log_time, "publish_time": each.publish_time}
                writer.add_message(
                    known[channel.id], data=each.data, sequence=each.sequence, **times
                )
        for kept in reader.iter_attachments() if others else ():
            when = kept.create_time, kept.log_time
            writer.add_attachment(*when, kept.name, kept.media_type, kept.data)
        for record in reader.iter_metadata() if others else ():
            writer.add_metadata(record.name, record.metadata)
        writer.finish()  # type: ignore[no-untyped-call]


SETTINGS: list[dict[str, Any]] = [
    {},
    {"compression": CompressionType.NONE},
    {"compression": CompressionType.LZ4},
    {"use_chunking": False},
    {"index_types": IndexType.NONE},
    {"repeat_channels": False, "repeat_schemas": False},
    {"use_statistics": False},
    {"use_statistics": False, "use_summary_offsets": False, "index_types": IndexType.NONE},
    {"enable_crcs": False},
]


@pytest.mark.parametrize("setting", SETTINGS, ids=str)
def test_a_copy_of_another_program_is_replayed(
    setting: dict[str, Any], segment: str, tmp_path: Path
) -> None:
    path, copy, part = (tmp_path / f"{name}.mcap" for name in ("run", "copy", "part"))
    with o80.robots.load("two_joints").inline(segment) as arm, o80.Recording(path, arm) as file:
        for i in range(5):
            file.mark("episode", number=i)
            arm.add_command("elbow", 0.1 * i, iterations=50)
            arm.burst(100)
            file.flush()
        rows = arm.history().rows.tobytes()
    copied(copy, path, **setting)
    copied(part, path, topics="joint_states", **setting)

    read = o80.open(copy)
    assert read[segment].history().rows.tobytes() == rows
    assert sorted(mark.values["number"] for mark in read.marks) == [0, 1, 2, 3, 4]
    assert o80.replay(copy).identical
    assert [*o80.open(part)] == []


def test_what_a_copy_lacks_is_named(segment: str, path: Path) -> None:
    copy = path.with_name("copy.mcap")
    with o80.robots.load("two_joints").inline(segment) as arm, o80.Recording(path, arm):
        arm.burst(100)
    copied(copy, path, others=False)
    with pytest.raises(o80.RecordingError, match=f"lacks the description of '{segment}'"):
        o80.open(copy)[segment].history()
    copied(copy, path, use_chunking=False)
    with pytest.raises(o80.RecordingError, match="another program"):
        o80.Recording(copy, segment, proceed=True)


FORMS = [("zstd", None, 0), ("lz4", "10k", 5000), ("none", "20k", 1 << 18)]  # LARGE, too


@pytest.fixture(params=FORMS, ids=str)
def everything(request: pytest.FixtureRequest, segment: str, path: Path) -> Path:
    """Two robots, one with two runs: commands, halts, a reset, marks of both kinds, transforms."""
    load = o80.robots.load("two_joints").inline
    second = f"{segment}-b"
    compression, split, large = request.param
    request.getfixturevalue("monkeypatch").setattr("o80.recording.file_writer.LARGE", large)
    form = {"compression": compression, "split": split}
    with load(segment) as arm, o80.Recording(path, [segment, second], **form) as recording:
        for run in range(2):
            with load(second) as other:
                for part in range(3):
                    recording.mark("episode", number=part, gains=[0.5, 1.0])
                    for robot in (arm, other):
                        robot.mark(f"part {part}")
                        robot.add_command("elbow", 0.1 * part + run, iterations=20)
                        robot.burst(30)
                        while recording._recorder.newest[robot.segment] != robot.published:
                            recording.flush()
                    recording.flush()
                other.request("reset", seed=run)
                arm.halt("the ball is on the floor")
                recording.flush()
                arm.resume()
                arm.burst(5)
            recording.flush()
            recording._recorder.sources[second]._attempt_at = 0.0  # now
    o80.clean(second)
    cut(path, path.with_name("shown.mcap"), transforms=60.0)
    return path


def rows_of(path: Path) -> dict[str, list[tuple[int, Any]]]:
    """Log times and rows of each segment, as o80 reads them."""
    recording = o80.open(path)
    found: dict[str, list[tuple[int, Any]]] = {}
    for name in recording:
        for epoch in recording[name].epochs:
            history = epoch.history()
            times = (history.time + epoch.wall_offset).tolist()
            found.setdefault(name, []).extend(zip(times, history, strict=True))
    return found


def test_all_that_a_recording_holds_is_read_by_others(everything: Path) -> None:
    expected = rows_of(everything)
    recording = o80.open(everything)
    for path in (everything, everything.with_name("shown.mcap")):
        read: dict[str, list[tuple[int, Any]]] = {}
        counts: dict[str, int] = {}
        for file in files_of(path):
            with file.open("rb") as content:
                reader = make_reader(content, validate_crcs=True)
                for _, channel, _ in reader.iter_messages():
                    counts[channel.topic] = counts.get(channel.topic, 0) + 1
            with AnyReader([file]) as bag:
                for each, time, raw in bag.messages():
                    message = bag.deserialize(raw, each.msgtype)
                    read.setdefault(each.topic, []).append((time, message))
        assert counts == {topic: len(found) for topic, found in read.items()}
        for name, rows in expected.items():
            found = read[topic_of(name)]
            assert [time for time, _ in found] == [time for time, _ in rows]
            joints = read[topic_of(name, "joint_states")]
            for (time, row), (_, message), (_, joint) in zip(rows, found, joints, strict=True):
                assert (message.iteration, message.time) == (row.iteration, row.time)
                for part in ("desired", "observed", "active"):
                    states = getattr(message, part)
                    assert [states.shoulder, states.elbow] == getattr(row, part).tolist()
                assert message.extended.effort.tolist() == row.extended.effort.tolist()
                assert joint.name == ["shoulder", "elbow"]
                assert joint.position.tolist() == row.observed.tolist()
                assert joint.effort.tolist() == row.extended.effort.tolist()
                assert len(joint.velocity) == 0
                stamp = joint.header.stamp
                assert stamp.sec * 10**9 + stamp.nanosec == time
            journal = read[topic_of(name, "journal")]
            assert [(each.first, each.next, bytes(each.entries)) for _, each in journal] == [
                (part.first, part.next, part.content)
                for epoch in recording[name].epochs
                for part in epoch.journal_parts()
            ]
        of_rows = {time for rows in expected.values() for time, _ in rows}
        marks = sorted((mark.name, mark.time) for mark in recording.marks)
        assert sorted((mark.name, mark.time) for _, mark in read["/o80/marks"]) == marks
        assert {time for time, _ in read["/o80/marks"]} <= of_rows
        texts = "\n".join(line.msg for _, line in read["/rosout"])
        assert texts.count("the ball is on the floor") == 2
        assert texts.count("elbow to 1.2 in 20 iterations: completed") == 2
        for time, line in read["/rosout"]:
            assert line.stamp.sec * 10**9 + line.stamp.nanosec == time
        assert ("/tf" in read) == (path != everything)


def columns_of_rerun(text: str, wanted: str) -> list[tuple[int, list[str]]]:
    """Log time and last cells of the rows of tables with such a column, which `rerun` prints."""
    found, has_it = [], False
    for line in text.splitlines():
        cells = [cell.strip(" │") for cell in line.split("┆")]
        if "RowId" in cells[0]:
            has_it = wanted in cells
        elif has_it and cells[0].startswith("row_"):
            moment, _, fraction = cells[1].partition(".")
            seconds = datetime.fromisoformat(f"{moment}+00:00").timestamp()
            found.append((int(seconds) * 10**9 + int(fraction.ljust(9, "0")), cells[2:]))
    return found


@pytest.mark.check
@pytest.mark.timeout(300)
def test_all_that_a_recording_holds_is_read_by_rerun(everything: Path, tmp_path: Path) -> None:
    rerun = shutil.which("rerun")
    if rerun is None:
        pytest.skip("rerun-sdk is not installed")
    expected = rows_of(everything)
    recording = o80.open(everything)
    shown = everything.with_name("shown.mcap")

    def run(*words: str | Path) -> str:
        done = subprocess.run(
            [rerun, *words], capture_output=True, text=True, check=True, timeout=100
        )
        assert "ERROR" not in done.stderr, done.stderr
        assert "multiple MCAP metadata records" not in done.stderr, done.stderr
        return done.stdout

    read = ""
    for number, file in enumerate([*files_of(everything), shown]):
        run("mcap", "convert", file, "-o", tmp_path / f"{number}.rrd")
        said = run("rrd", "print", "-vvv", tmp_path / f"{number}.rrd")
        read = said if file == shown else read + said
        if file != files_of(everything)[-1] and file != shown:
            continue
        positions = sorted(
            (time, [float(number) for number in re.findall(r"[-+.\de]+", cells[-2])])
            for time, cells in columns_of_rerun(read, "Scalars:scalars")
            if cells[-1] == "[shoulder, elbow]"
        )
        assert positions
        observed = {time: row.observed.tolist() for rows in expected.values() for time, row in rows}
        assert {time for time, _ in positions} == set(observed)
        near = [values == observed[time] for time, values in positions]
        assert sum(near) >= len(observed)
        lines = columns_of_rerun(read, "TextLog:text")
        said = "\n".join(text for _, cells in lines for text in cells)
        assert said.count("the ball is on the floor") == 2
        marks = columns_of_rerun(read, "o80.msg.Mark:message")
        names = [re.search(r"name: ([^,]*), time: (\d+)", cells[-1]) for _, cells in marks]
        assert sorted((each[1], int(each[2])) for each in names if each) == sorted(
            (mark.name, mark.time) for mark in recording.marks
        )
    transforms = columns_of_rerun(read, "Transform3D:translation")
    assert {cells[1] for _, cells in transforms} == {
        f"[{name}/{body}]" for name in expected for body in ("upper", "lower")
    }


def test_decisions_that_cannot_be_told_in_words_are_recorded_all_the_same(
    arm: o80.Frontend, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def newer(*_: Any) -> str:
        raise LookupError("request 999")

    monkeypatch.setattr("o80.recording.log_channel.status_text", newer)
    with o80.Recording(path, arm):
        arm.add_command("elbow", 0.5, iterations=20)
        arm.burst(30)
    assert repr(o80.open(path)[arm.segment].epochs[0].journal()) == repr(arm.journal())
    lines = messages_of(path, "/rosout")
    assert any("cannot be shown as text: request 999" in line.msg for _, line in lines)


def test_names_with_one_topic_are_not_recorded_together(segment: str, path: Path) -> None:
    near = segment.replace("-", "_")
    load = o80.robots.load("two_joints").inline
    with load(segment), load(near):
        with pytest.raises(o80.RecordingError, match="rename one") as refused:
            Recorder(path, [segment, near])
        assert near in str(refused.value)
        assert not path.exists()
    with load(segment):
        recorder = Recorder(path, [segment.replace("-", "?")])
        with load(near):
            recorder._search_at = 0.0  # now
            with pytest.warns(RuntimeWarning, match="rename one"):
                recorder.poll()
        recorder.finish()
    assert [*o80.open(path)] == [segment]


def test_wherever_it_is_cut_whole_chunks_are_read_and_continued(
    recorded: tuple[Path, o80.History], arm: o80.Frontend
) -> None:
    path, history = recorded
    whole = path.read_bytes()
    groups = {0, *(each.chunk_start_offset for each in scan(path).chunks), len(whole) - 1}
    assert len(groups) > 20
    chance = np.random.default_rng(3)
    for place in [*groups, *chance.integers(0, len(whole), CUTS)]:
        path.write_bytes(whole[: int(place)])
        o80.Recording(path, arm, proceed=True).close()

        segment = o80.open(path)[arm.segment]
        read = segment.history()
        assert read.rows.tobytes() == history.rows.tobytes(), f"cut at {place}"
        assert repr(segment.epochs[0].journal()) == repr(arm.journal()), f"cut at {place}"
        assert rows_in(path, arm) == len(read)


def test_the_last_rows_and_decisions_are_read_from_the_last_chunks(
    arm: o80.Frontend, path: Path
) -> None:
    recorder = Recorder(path, [arm.segment])
    for i in range(10):
        if i in (2, 4, 5):
            arm.add_command("shoulder" if i == 4 else "elbow", 0.1, iterations=70)
        arm.burst(20)
        recorder.poll()
    recorder.finish()
    rows, journal, data = arm.history(), arm.journal(), bytearray(path.read_bytes())
    for chunk in [*scan(path).chunks][:4]:
        data[chunk.chunk_start_offset + 60] ^= 0xFF
    path.write_bytes(data)

    epoch = o80.open(path)[arm.segment].epochs[0]
    assert epoch.history(50).rows.tobytes() == rows[-50:].rows.tobytes()
    last = epoch.history(seconds=0.05)
    assert last.rows.tobytes() == rows.select(seconds=0.05).rows.tobytes()
    some = epoch.history(since=150, until=170)
    assert some.rows.tobytes() == rows.select(since=150, until=170).rows.tobytes()
    observed = epoch.history(since=150, until=170, fields="observed")
    assert np.array_equal(observed, some.observed)
    ends = [each for each in command_ends(journal) if each.iteration >= last.iteration[0]]
    found = command_ends(epoch.journal_since_row(int(last.iteration[0])))
    assert ends
    assert [each for each in found if each.iteration >= last.iteration[0]] == ends
    with pytest.raises(o80.RecordingError, match="damaged"):
        epoch.history(len(rows))


def test_a_long_scan_is_told(
    recorded: tuple[Path, o80.History],
    arm: o80.Frontend,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path, history = recorded
    path.write_bytes(path.read_bytes()[:-100])
    monkeypatch.setattr(progress, "AFTER", 0.0)
    monkeypatch.setattr("o80.recording.scan.BETWEEN_FIGURES", 5)
    with pytest.warns(RuntimeWarning, match="has no summary .* o80 repair") as told:
        assert len(o80.open(path)[arm.segment].history()) == len(history)
    assert len(told) == 1
    monkeypatch.setattr(progress, "of_a_command", True)
    monkeypatch.setattr(progress, "BETWEEN", 0.0)
    o80.open(path)
    assert capsys.readouterr().err.count("has no summary") == 1
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    o80.open(path)
    figures = [int(each) for each in re.findall(r"(\d+)%", capsys.readouterr().err)]
    assert len(figures) > 2
    assert 0 < figures[0] < figures[-1] <= 100
    assert figures == sorted(figures)


def test_a_disk_without_room_for_the_beginning_of_a_file_is_left_without_it(tmp_path: Path) -> None:
    path = tmp_path / "0004.mcap"
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10, limits[1]))
    try:
        with pytest.raises(OSError, match="large"):
            FileWriter(path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert not path.exists()


def record_for_ever(arm: o80.Frontend, recorder: Recorder) -> None:
    while True:
        arm.burst(500)
        recorder.poll()


def test_a_full_disk_ends_in_an_error_and_a_file_that_readers_open(
    arm: o80.Frontend, path: Path
) -> None:
    recorder = Recorder(path, [arm.segment], form=Form("none"))
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (250_000, limits[1]))
    try:
        with pytest.raises(o80.RecordingError, match="cannot be written any more"):
            record_for_ever(arm, recorder)
        recorder.finish()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)

    rows = o80.open(path)[arm.segment].history()
    assert np.array_equal(rows.iteration, np.arange(len(rows)))
    assert rows_in(path, arm) == len(rows)
    assert path.stat().st_size <= 250_000
