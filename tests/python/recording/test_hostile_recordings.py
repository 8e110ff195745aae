"""A damaged or hostile recording is refused with a message; it never crashes what reads it."""

import json
import random
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.records import ChunkIndex
from processes import run_o80

import o80
from o80 import _core
from o80.base.machine import Machine
from o80.cli.cut import merge
from o80.cli.info import info as info_command
from o80.cli.save import repair
from o80.recording.blocks import messages_in
from o80.recording.epoch import EpochNote, Gap
from o80.recording.locked_file import LockedFile
from o80.recording.scan import content_of, index_of, scan
from o80.replaying.recorded_run import runs_in
from o80.rows.provenance import Provenance

RECORDINGS = Path(__file__).resolve().parents[2] / "data" / "recordings"
RECORDING = RECORDINGS / "codec_1.mcap"
# entries of a journal: the place of the kind; of lane, what, iteration and id; where values begin
KIND, OTHERS, VALUES = 4, (5, 6, 18, 26), 34


def record(path: Path, segment: str) -> Path:
    with o80.robots.load("two_joints").inline(segment) as arm, o80.Recording(path, arm) as file:
        file.mark("episode", task="x")
        arm.burst(20)
    return path


@pytest.mark.parametrize("name", ["../../evil", "/etc/x", "x\x1b[31m", "", ".hidden", "a" * 65])
def test_a_name_that_leads_elsewhere_is_refused(
    name: str, segment: str, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    texts = EpochNote.texts
    monkeypatch.setattr(EpochNote, "texts", lambda self: texts(self) | {"segment": name})
    record(path, segment)
    with pytest.raises(o80.RecordingError, match="cannot be the name of a segment") as refused:
        o80.open(path)
    assert "\x1b" not in str(refused.value)


PROVENANCES = [
    "null",
    "[]",
    "[" * 100_000,
    '{"robot": 5}',
    '{"options": "abc"}',
    '{"options": {"gain": 3}}',
    '{"run_options": [1]}',
    '{"files": [{"option": 1, "path": 2, "sha256": 3}]}',
    '{"files": [[]]}',
    '{"motion_rules": "one"}',
    '{"motion_rules": null}',
    '{"motion_rules": 1.5}',
    '{"motion_rules": -1}',
    '{"library": {"a": 1}}',
    '{"wall_clock_offset": "soon"}',
    '{"version": null}',
]


@pytest.mark.parametrize("text", PROVENANCES)
def test_a_damaged_provenance_is_told(
    text: str,
    segment: str,
    path: Path,
    tmp_path: Path,
    forged: dict[str, Any],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    good = record(tmp_path / "good.mcap", segment)
    if text.startswith("{"):
        forged |= json.loads(text)
    else:
        monkeypatch.setattr(Provenance, "as_json", lambda _: text)
    record(path, segment)
    (epoch,) = o80.open(path)[segment].epochs
    assert len(epoch.history()) == 21
    for read in (lambda: epoch.provenance, lambda: o80.replay(path)):
        with pytest.raises(o80.RecordingError, match="provenance is damaged"):
            read()
    merge([good, path], tmp_path / "both.mcap")
    first, second = o80.replay(tmp_path / "both.mcap")
    assert (first.identical, "provenance is damaged" in second.gap) == (True, True)


@pytest.mark.parametrize("values", ["", "{", "[1]", "5", "[" * 100_000])
def test_a_mark_with_damaged_values_is_refused(
    values: str, segment: str, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("o80.recording.marks.json_text", lambda *_, **__: values)
    record(path, segment)
    with pytest.raises(o80.RecordingError):
        _ = o80.open(path).marks


def test_texts_of_a_recording_do_not_control_the_terminal(
    segment: str, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    as_json, forged = Machine.as_json, {"libc": "\x1b[2J\x07 1"}
    monkeypatch.setattr(
        Machine, "as_json", lambda self: json.dumps(json.loads(as_json(self)) | forged)
    )
    record(path, segment)
    done = run_o80("replay", path, code=None)
    assert "recorded it" in done.stdout
    assert not {"\x1b", "\x07"} & set(done.stdout + done.stderr)


# ---------------------------------------------------------------------------- random damage


def changed(journal: bytes, choose: random.Random) -> bytes:
    """A journal some of whose entries say something else."""
    places = []
    at = 0
    while at < len(journal):
        (length,) = struct.unpack_from("<I", journal, at)
        places.append((at, length - VALUES))
        at += length
    damaged = bytearray(journal)
    for _ in range(choose.randrange(1, 6)):
        at, size = choose.choice(places)
        how = choose.randrange(4)
        if how == 0:
            damaged[at + KIND] = choose.randrange(25)  # another kind
        elif how == 1 and size > 0:
            damaged[at + VALUES + choose.randrange(size)] = choose.randrange(256)
        elif how == 2 and size >= 8:
            word = choose.choice([-1, 2**63 - 1, -(2**63), 2**31, 0xFFFF, choose.randrange(64)])
            struct.pack_into("<q", damaged, at + VALUES + 8 * choose.randrange(size // 8), word)
        else:
            damaged[at + choose.choice([KIND, *OTHERS])] = choose.randrange(256)
    return bytes(damaged)


@pytest.mark.parametrize("segment", ["joints", "bench"])
def test_a_replay_of_a_damaged_journal_ends_in_order(segment: str) -> None:
    (run, *_) = runs_in(o80.open(RECORDING), segment)
    journal = b"".join(entries.content for entries in run.epoch.journal_parts())
    rows = b"".join(np.ascontiguousarray(block.rows).tobytes() for block in run.blocks())
    size = next(run.blocks()).rows.itemsize
    loop = [("bursting", "true"), ("lane_blocks", "1024"), ("history", "1024")]
    told = 0
    for seed in range(150):
        choose = random.Random(seed)
        damaged = bytearray(rows)
        for _ in range(choose.randrange(3)):
            at = choose.randrange(len(rows))
            if at % size >= 8:  # not its iteration
                damaged[at] = choose.randrange(256)
        name = _core.unused_segment_name("replay")
        replay = _core.DriverlessReplay(run.description, name, loop, run.schema["period"])
        try:
            decoder = _core.RecordedJournal(run.description, 0)
            replay.add(decoder.decode(changed(journal, choose), _core.JOURNAL_CODEC))
            replay.run(bytes(damaged))
        except o80.Error:
            told += 1
        finally:
            replay.close()
            _core.clean(name)
    assert 0 < told < 150


def damaged(data: bytes, draw: random.Random) -> bytes:
    """A file with flipped, cut, duplicated or spliced bytes."""
    a, b = sorted(draw.randrange(len(data)) for _ in range(2))
    to = draw.randrange(len(data))
    return {
        "flip": lambda: data[:a] + bytes([data[a] ^ (1 << draw.randrange(8))]) + data[a + 1 :],
        "cut": lambda: data[:a],
        "splice": lambda: data[:a] + data[b:],
        "duplicate": lambda: data[:b] + data[a:b] + data[b:],
        "move": lambda: data[:a] + data[to:] + data[a:b],
        "zero": lambda: data[:a] + bytes(min(b - a, 64)) + data[min(b, a + 64) :],
        "tail": lambda: data[:a] + data[-min(b, 400) :],
    }[draw.choice(["flip", "cut", "splice", "duplicate", "move", "zero", "tail"])]()


def read_all(path: Path) -> None:
    recording = o80.open(path)
    _ = recording.marks, recording.finished, recording.time_range
    for name in recording:
        for epoch in recording[name].epochs:
            _ = epoch.gaps, epoch.end, epoch.provenance, epoch.machine, epoch.interruption
            epoch.history()
            epoch.journal()


def info_of(path: Path) -> None:
    info_command(str(path))


def with_changed_index(whole: bytes, indexes: bytes, at: int) -> bytes:
    """A file with another byte in the chunk indexes of its summary, whose checksum is right."""
    data, (begin,) = bytearray(whole), struct.unpack_from("<Q", whole, len(whole) - 28)
    data[whole.index(indexes, begin) + at] ^= 0xFF
    data[-12:-8] = struct.pack("<I", zlib.crc32(data[begin:-12]))
    return bytes(data)


def test_a_file_damaged_anywhere_is_read_or_refused_in_a_sentence(segment: str, path: Path) -> None:
    whole = record(path, segment).read_bytes()
    indexes = bytes(scan(path).chunks.records)
    files = [damaged(whole, random.Random(seed)) for seed in range(200)]
    files += [with_changed_index(whole, indexes, at) for at in range(len(indexes))]
    sentences = set()
    for number, data in enumerate(files):
        damaged_file = path.parent / f"{number}" / "damaged.mcap"
        damaged_file.parent.mkdir()
        damaged_file.write_bytes(data)
        for read in (read_all, info_of, repair, read_all):
            try:
                read(damaged_file)
            except o80.Error as refused:
                sentences.add(str(refused).replace(str(damaged_file), "PATH"))
            except Exception as error:
                raise AssertionError(f"file {number}: {read.__name__}") from error
    assert all("PATH" in each for each in sentences)


def iterations_in(path: Path, chunk: ChunkIndex, channel: int) -> set[int]:
    if channel not in chunk.message_index_offsets:
        return set()
    with path.open("rb") as file:
        messages = messages_in(content_of(file, chunk), index_of(file, chunk, channel))
    return {int.from_bytes(each[4:12].tobytes(), "little") for each in messages}


@pytest.mark.parametrize("finished", [True, False])
@pytest.mark.parametrize("part", ["content", "length", "opcode", "index"])
def test_repair_keeps_all_rows_but_those_of_a_damaged_chunk(
    part: str, finished: bool, segment: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = tmp_path / "whole.mcap"
    with o80.robots.load("two_joints").inline(segment) as arm, o80.Recording(whole, arm) as file:
        for i in range(4):
            file.flush()
            arm.add_command("elbow", 0.1 * i, iterations=10)
            arm.burst(25)
            arm.mark(f"{i}")
    rows, found = o80.open(whole)[segment].history(), scan(whole)
    assert len(found.chunks) > 3
    for number, chunk in enumerate(found.chunks):
        begin, index = chunk.chunk_start_offset, min(chunk.message_index_offsets.values())
        at = {"content": index - 1, "length": begin + 4, "opcode": begin, "index": index + 20}[part]
        data = bytearray(whole.read_bytes() if finished else whole.read_bytes()[: found.end])
        data[at] ^= 0x55
        path = tmp_path / f"{number}" / "run.mcap"
        path.parent.mkdir()
        path.write_bytes(data)
        if begin == found.chunks[-1].chunk_start_offset and not finished:
            continue  # as after a kill
        repair(path)
        said = capsys.readouterr().out

        assert (path.parent / "run.mcap.damaged").read_bytes() == data
        repair(path)
        assert "is complete" in capsys.readouterr().out
        epoch = o80.open(path)[segment].epochs[0]
        lost = iterations_in(whole, chunk, epoch._parts[0].channel)
        if part == "index" or (finished and part != "content"):  # the summary has it
            lost = set()
        kept = epoch.history()
        assert set(rows.iteration.tolist()) - set(kept.iteration.tolist()) == lost
        same = rows.rows[np.isin(rows.iteration, kept.iteration)]
        assert all(np.array_equal(kept.rows[name], same[name]) for name in same.dtype.names or ())
        if lost:
            is_end = max(lost) == rows.iteration[-1]
            gap = Gap(min(lost), None if is_end else max(lost), "damaged")
            assert gap in epoch.gaps
            assert f"{segment}: {gap}" in said
            assert "were damaged" in said


def test_repair_overwrites_no_damaged_file_that_was_kept_and_none_that_is_written(
    segment: str, path: Path
) -> None:
    record(path, segment)
    data = bytearray(path.read_bytes())
    data[min(scan(path).chunks[0].message_index_offsets.values()) - 1] ^= 1
    path.write_bytes(data)
    lock = LockedFile(path, 0)
    with pytest.raises(o80.RecordingError, match="being written"):
        repair(path)
    lock.close()
    kept = path.with_name("run.mcap.damaged")
    kept.write_bytes(b"kept")
    with pytest.raises(o80.RecordingError, match="repaired before"):
        repair(path)
    assert (path.read_bytes(), kept.read_bytes()) == (bytes(data), b"kept")
