"""Recordings of a newer o80, or under other motion rules: what is read, and where a replay stops.

The newer o80 is this one, which forges what it writes into the file.
"""

import json
import math
import struct
from pathlib import Path
from typing import Any

import pytest
from processes import WAIT, run_o80

import o80
from o80 import _core
from o80.base.words import ProfileWord
from o80.recording.journal_channel import Entries
from o80.recording.recorder import Recorder
from o80.replaying.entry_feed import MotionRules

NEWER = _core.JOURNAL_CODEC + 1
RECORDS, LATER = 1, 99  # kinds of an entry


def o80_command(*words: str | Path) -> tuple[int, str]:
    done = run_o80(*words, code=None)
    return done.returncode, " ".join((done.stdout + done.stderr).split())


def record(path: Path, segment: str) -> Path:
    """Two commands: one in row 1, one in row 11."""
    with o80.robots.load("two_joints").inline(segment) as arm, o80.Recording(path, arm):
        for target in (0.5, 1.0):
            arm.add_command("elbow", target, iterations=5)
            arm.burst(10)
    return path


# ---------------------------------------------------------------------------- a newer version


@pytest.fixture
def newer(segment: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A recording whose journal is in a newer version of the format."""
    with monkeypatch.context() as forged:
        forged.setattr(_core, "JOURNAL_CODEC", NEWER)
        return record(tmp_path / "run.mcap", segment)


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
    for words, wanted in ((["replay"], 2), (["echo", "--commands"], 1)):
        code, said = o80_command(*words, newer)
        assert code == wanted
        assert f"version {NEWER} of the format" in said
    assert f"for a newer o80 (format {NEWER})" in o80_command("info", newer)[1]
    _, text = o80_command("info", newer, "--json")
    assert json.loads(text)[0]["journal_codec"] == NEWER


def test_a_journal_of_another_version_is_not_continued(
    segment: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "run.mcap"
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
    codec: str, segment: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as forged:
        forged.setattr(_core, "JOURNAL_CODEC", codec)
        path = record(tmp_path / "run.mcap", segment)
    with pytest.raises(o80.RecordingError):
        o80.open(path)[segment].epochs[0].journal()
    code, said = o80_command("info", path)
    assert (code, "Traceback" in said) == (1, False)


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
    segment: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    honest, what = Entries.message, f"entry kind {LATER}"

    def forged(self: Entries) -> bytes:
        return honest(Entries(self.first, self.next, with_later_kind(self.content)))

    with monkeypatch.context() as forging:
        forging.setattr(Entries, "message", forged)
        path = record(tmp_path / "run.mcap", segment)
    entries = o80.open(path)[segment].epochs[0].journal()
    (unknown,) = (each for each in entries if each.unknown)

    assert (unknown.unknown, unknown.iteration) == (what, 11)
    code, said = o80_command("replay", path)
    assert code == 2
    assert "11 rows, identical up to row 10; then entry" in said
    assert f"does not know ({what})" in said
    assert "Traceback" not in said
    _, said = o80_command("echo", "--commands", path)
    assert f"something of a newer o80 ({what})" in said
    played = f"{segment}-again"
    with o80.play(path, names={segment: played}, speed=math.inf) as playback:
        assert playback.wait(WAIT)
        with o80.Frontend(played) as arm:
            assert repr(arm.journal()) == repr(entries)


# ---------------------------------------------------------------------------- motion rules


def record_limited(path: Path, segment: str, profile: ProfileWord = "linear") -> Path:
    """A command of an actuator without a limit of speed in row 1, of one with it in 11."""
    limits = {"lift": (-1.0, 1.0, 2.0)}
    with o80.Backend(segment, ["free", "lift"], limits=limits) as backend:
        backend.publish([0.0, 0.0])
        with o80.Frontend(segment) as arm, o80.Recording(path, arm) as recording:
            recording.flush()
            for name in ("free", "lift"):
                arm.add_command(name, 0.1, iterations=8, profile=profile)
                arm.pulse()
                for _ in range(10):
                    backend.publish(backend.step())
    return path


def test_a_recording_says_under_which_motion_rules_it_was_made(
    segment: str, tmp_path: Path
) -> None:
    path = record_limited(tmp_path / "run.mcap", segment)

    (epoch,) = o80.open(path)[segment].epochs
    assert epoch.provenance.motion_rules == _core.MOTION_RULES
    assert f"motion rules {_core.MOTION_RULES}" in o80_command("info", path)[1]
    code, said = o80_command("replay", path)
    assert (code, "21 rows, no driver was started: desired states identical" in said) == (0, True)
    assert "motion rules" not in said


@pytest.mark.parametrize("other", [_core.MOTION_RULES - 1, _core.MOTION_RULES + 1])
def test_under_other_rules_rows_are_compared_up_to_the_first_command_that_they_change(
    other: int, segment: str, tmp_path: Path, forged: dict[str, Any]
) -> None:
    forged["motion_rules"] = other
    path = record_limited(tmp_path / "run.mcap", segment)
    (run,) = o80.replay(path)

    assert run.difference is None
    assert not run.identical
    assert run.rows == 11  # up to row 10
    now = _core.MOTION_RULES
    assert f"command of lift, which motion rules {now} may move otherwise" in run.gap
    code, said = o80_command("replay", path)
    assert code == 2
    assert "states identical up to row 10; then row 11 begins a command of lift" in said
    assert f"note: it moved by motion rules {other}, this o80 has motion rules {now}" in said


def test_rules_that_change_no_command_of_the_run_are_noted(
    segment: str, tmp_path: Path, forged: dict[str, Any]
) -> None:
    forged["motion_rules"] = 77
    path = record(tmp_path / "run.mcap", segment)
    (run,) = o80.replay(path)

    assert run.identical, run
    assert any("it moved by motion rules 77" in note for note in run.notes)


def test_the_first_command_is_found_whatever_the_rules_are(segment: str, tmp_path: Path) -> None:
    profiles: list[tuple[ProfileWord, list[int]]] = [("linear", [11]), ("minimum_jerk", [1, 11])]
    for profile, changed in profiles:
        path = record_limited(tmp_path / f"{profile}.mcap", segment, profile)
        (epoch,) = o80.open(path)[segment].epochs
        entries = list(epoch.native_journal())
        for recorded, now in ((1, 1), (2, 2), (1, 2), (3, 2)):
            rules = MotionRules.of(epoch.schema, recorded, now)
            moved = [entry.iteration for entry in entries if rules.moved_otherwise(entry)]
            assert moved == (changed if recorded != now else []), (profile, recorded, now)
