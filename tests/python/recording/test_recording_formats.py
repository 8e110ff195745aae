"""Recordings of earlier versions are read as they were then; what is read of newer ones, which this
o80 forges, and of those under other motion rules, and where a replay stops.
"""

import json
import math
import runpy
import struct
from pathlib import Path
from typing import Any

import pytest
from manual_backend import ManualBackend
from processes import WAIT, o80_says

import o80
from o80 import _core
from o80.base.words import ProfileWord
from o80.recording.journal_channel import Entries
from o80.recording.reader import files_of
from o80.recording.recorder import Recorder
from o80.rows.columns import columns_of

RECORDINGS = Path(__file__).resolve().parents[2] / "data" / "recordings"
NAMES = [path.stem for path in sorted(RECORDINGS.glob("*.mcap"))]
CODECS = {"codec_1": 1, "kinds_1": 1}  # of their journals
JOURNALS = [name for name in NAMES if name.startswith("codec")]


def test_there_is_a_recording_of_each_version_of_the_format() -> None:
    assert sorted(CODECS) == sorted(NAMES)
    assert set(CODECS.values()) == set(range(1, _core.JOURNAL_CODEC + 1))
    assert _core.MOTION_RULES in set(map(motion_rules, NAMES))  # else a replay shows nothing


def motion_rules(name: str) -> int | None:
    (segment, *_) = o80.open(RECORDINGS / f"{name}.mcap").segments.values()
    return segment.epochs[0].provenance.motion_rules


@pytest.mark.parametrize("name", NAMES)
def test_a_recording_of_an_earlier_version_is_read(name: str) -> None:
    path = RECORDINGS / f"{name}.mcap"
    expected = json.loads(path.with_suffix(".json").read_text())

    found_in = runpy.run_path(str(RECORDINGS / "make.py"))["found_in"]
    assert json.loads(json.dumps(found_in(path))) == expected
    for segment in o80.open(path).segments.values():
        for epoch in segment.epochs:
            assert epoch.journal_codec == CODECS[name]
            paths = [each.name for each in columns_of(epoch.schema)]
            history, columns = epoch.history(), epoch.history(fields=paths)
            for each, column in zip(paths, columns, strict=True):
                assert (each, column.tobytes()) == (each, history[each].tobytes())


@pytest.mark.parametrize("driver", [False, True])
@pytest.mark.parametrize("name", NAMES)
def test_a_replay_of_an_earlier_version_finds_no_difference(name: str, driver: bool) -> None:
    report = o80.replay(RECORDINGS / f"{name}.mcap", driver=driver)

    assert not report.difference
    assert report.identical or motion_rules(name) != _core.MOTION_RULES, report


def test_a_recording_of_an_earlier_version_holds_fields_of_each_kind() -> None:
    (epoch,) = o80.open(RECORDINGS / "kinds_1.mcap")["kinds"].epochs
    row: Any = epoch.history()[-1]

    assert len(files_of(RECORDINGS / "kinds_1.mcap")) == 2
    assert {row.extended[f"n_{kind}"].item() for kind in ("u1", "i4", "u8", "f4")} == {60}
    assert (row.desired.hand.tool.name, row.desired.tool.name) == ("HOOK", "BRUSH")
    assert row.extended.grid.tolist() == [[60, 61, 62], [63, 64, 65]]
    assert row.extended.cells[0].item() == (False, 60.0, pytest.approx([60, -60]))
    assert (row.desired.wrist[0], row.desired.valve, row.extended.tool.name) == (0.5, True, "NONE")


@pytest.mark.parametrize("name", JOURNALS)
def test_a_recording_of_an_earlier_version_is_played(name: str, segment: str) -> None:
    path, prefix = RECORDINGS / f"{name}.mcap", f"{segment}-"
    (*_, run) = o80.open(path)["joints"].epochs
    with o80.play(path, ["joints"], prefix=prefix, speed=math.inf) as playback:
        assert playback.wait(WAIT)
        with o80.Frontend(f"{prefix}joints", dead=True) as arm:
            assert repr(arm.journal()) == repr(run.journal()[:-1])  # without its end


NEWER = _core.JOURNAL_CODEC + 1
RECORDS, LATER = 1, 99  # kinds of an entry


def told(*words: str | Path, code: int = 0) -> str:
    return " ".join(o80_says(*words, code=code).split())


def record(path: Path, segment: str) -> Path:
    """Two commands: one in row 1, one in row 11."""
    with o80.robots.load("two_joints").inline(segment) as arm, o80.Recording(path, arm):
        for target in (0.5, 1.0):
            arm.add_command("elbow", target, iterations=5)
            arm.burst(10)
    return path


# ---------------------------------------------------------------------------- a newer version


@pytest.fixture
def newer(segment: str, path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A recording whose journal is in a newer version of the format."""
    with monkeypatch.context() as forged:
        forged.setattr(_core, "JOURNAL_CODEC", NEWER)
        return record(path, segment)


SAID = f"version {NEWER} .* reads version {_core.JOURNAL_CODEC}: read it with a newer o80"


def test_a_newer_version_is_refused_with_a_message(newer: Path, segment: str) -> None:
    (epoch,) = o80.open(newer)[segment].epochs

    with pytest.raises(o80.RecordingError, match=SAID):
        epoch.journal()
    with pytest.raises(o80.RecordingError, match=SAID):
        o80.replay(newer)
    with (
        pytest.raises(o80.RecordingError, match=SAID),
        o80.play(newer, prefix="old-", speed=math.inf) as playback,
    ):
        playback.wait(WAIT)
    assert epoch.history().iteration.tolist() == list(range(21))  # rows are readable all the same


def test_commands_tell_a_newer_version(newer: Path) -> None:
    for words, code in ((["replay"], 2), (["echo", "--commands"], 1)):
        assert f"version {NEWER} of the format" in told(*words, newer, code=code)
    assert f"for a newer o80 (format {NEWER})" in told("info", newer)
    assert json.loads(told("info", newer, "--json"))[0]["journal_codec"] == NEWER


def test_a_journal_of_another_version_is_not_continued(
    segment: str, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with o80.robots.load("two_joints").inline(segment) as arm:
        with monkeypatch.context() as forged:
            forged.setattr(_core, "JOURNAL_CODEC", NEWER)
            with o80.Recording(path, arm):
                arm.burst(5)
        with pytest.raises(o80.RecordingError, match="another o80 has begun the journal"):
            Recorder(path, [segment], proceed=True)
    # another run of the robot has a journal of its own
    with (
        o80.robots.load("two_joints").inline(segment) as arm,
        o80.Recording(path, arm, proceed=True),
    ):
        arm.burst(5)
    assert [epoch.journal_codec for epoch in o80.open(path)[segment].epochs] == [
        NEWER,
        _core.JOURNAL_CODEC,
    ]


@pytest.mark.parametrize("codec", ["", "one", "-1", "1e3", "9" * 30])
def test_a_damaged_version_is_told(
    codec: str, segment: str, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as forged:
        forged.setattr(_core, "JOURNAL_CODEC", codec)
        record(path, segment)
    with pytest.raises(o80.RecordingError):
        o80.open(path)[segment].epochs[0].journal()
    told("info", path, code=1)


# ---------------------------------------------------------------------------- unknown kinds


def with_later_kind(content: bytes) -> bytes:
    """The second entry of records gets a kind that this o80 does not know."""
    forged = bytearray(content)
    at, found = 0, []
    while at < len(content):
        length, kind = struct.unpack_from("<IB", content, at)
        found += [at] if kind == RECORDS else []
        at += length
    forged[found[1] + 4] = LATER
    return bytes(forged)


def test_what_a_newer_o80_recorded_is_listed_and_ends_a_replay(
    segment: str, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    honest, what = Entries.message, f"entry kind {LATER}"

    def forged(self: Entries) -> bytes:
        return honest(Entries(self.first, self.next, with_later_kind(self.content)))

    with monkeypatch.context() as forging:
        forging.setattr(Entries, "message", forged)
        record(path, segment)
    entries = o80.open(path)[segment].epochs[0].journal()
    (unknown,) = (each for each in entries if each.unknown)

    assert (unknown.unknown, unknown.iteration) == (what, 11)
    said = told("replay", path, code=2)
    assert "11 rows, identical up to row 10; then entry" in said
    assert f"does not know ({what})" in said
    assert f"something of a newer o80 ({what})" in told("echo", "--commands", path)
    played = f"{segment}-again"
    with o80.play(path, names={segment: played}, speed=math.inf) as playback:
        assert playback.wait(WAIT)
        with o80.Frontend(played) as arm:
            assert repr(arm.journal()) == repr(entries)


# ---------------------------------------------------------------------------- motion rules


def record_limited(path: Path, segment: str, profile: ProfileWord = "linear") -> Path:
    """A command of an actuator without a limit of speed in row 1, of one with it in 11."""
    limits = {"lift": (-1.0, 1.0, 2.0)}
    with (
        ManualBackend(segment, ["free", "lift"], limits=limits) as robot,
        o80.Recording(path, segment) as recording,
    ):
        recording.flush()
        for name in ("free", "lift"):
            robot.frontend.add_command(name, 0.1, iterations=8, profile=profile)
            robot.frontend.pulse()
            robot.run(10)
    return path


def test_a_recording_says_under_which_motion_rules_it_was_made(segment: str, path: Path) -> None:
    record_limited(path, segment)

    (epoch,) = o80.open(path)[segment].epochs
    assert epoch.provenance.motion_rules == _core.MOTION_RULES
    assert f"motion rules {_core.MOTION_RULES}" in told("info", path)
    said = told("replay", path)
    assert "21 rows, no driver was started: desired states identical" in said
    assert "motion rules" not in said


@pytest.mark.parametrize("other", [_core.MOTION_RULES - 1, _core.MOTION_RULES + 1])
@pytest.mark.parametrize(
    ("profile", "name", "row"), [("linear", "lift", 11), ("minimum_jerk", "free", 1)]
)
def test_under_other_rules_rows_are_compared_up_to_the_first_command_that_they_change(
    profile: ProfileWord,
    name: str,
    row: int,
    other: int,
    segment: str,
    path: Path,
    forged: dict[str, Any],
) -> None:
    forged["motion_rules"] = other
    record_limited(path, segment, profile)
    (run,) = o80.replay(path)

    assert run.difference is None
    assert not run.identical
    assert run.rows == row
    now = _core.MOTION_RULES
    assert f"command of {name}, which motion rules {now} may move otherwise" in run.gap
    said = told("replay", path, code=2)
    assert (
        f"states identical up to row {row - 1}; then row {row} begins a command of {name}" in said
    )
    assert f"note: it moved by motion rules {other}, this o80 has motion rules {now}" in said


def test_rules_that_change_no_command_of_the_run_are_noted(
    segment: str, path: Path, forged: dict[str, Any]
) -> None:
    forged["motion_rules"] = 77
    record(path, segment)
    (run,) = o80.replay(path)

    assert run.identical, run
    assert any("it moved by motion rules 77" in note for note in run.notes)
