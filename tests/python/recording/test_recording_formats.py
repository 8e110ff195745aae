"""Recordings that earlier versions of o80 wrote are read as they were then."""

import json
import math
import runpy
from pathlib import Path
from typing import Any

import pytest
from processes import WAIT

import o80
from o80 import _core
from o80.recording.reader import files_of
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
def test_the_recordings_hold_what_a_journal_can_tell(name: str) -> None:
    """Except what only a race or damage brings about: the tests of the codec have that."""
    (bench,) = o80.open(RECORDINGS / f"{name}.mcap")["bench"].epochs
    entries = bench.journal()
    for epoch in o80.open(RECORDINGS / f"{name}.mcap")["joints"].epochs:
        entries += epoch.journal()
    commands = [command for entry in entries for command in entry.commands]

    assert {entry.kind for entry in entries} == {
        *("taken", "scheduled", "rejected", "status", "halt", "resume", "control_taken"),
        *("control_released", "control_lost", "burst", "burst_ended", "died", "silent"),
        *("interrupted", "fresh_start", "ended", "snapshot", "chunk_begun"),
    }
    assert {command.kind for command in commands} == {
        *("command", "purge", "request", "take_control", "release_control", "resume"),
        "close_plan",
    }
    assert {command.pace for command in commands} - {""} == {
        *("direct", "duration", "speed", "until", "iterations", "fastest", "chunk")
    }
    assert {command.profile for command in commands} - {""} == {
        *("linear", "minimum_jerk", "monotone", "smooth")
    }
    assert {command.mode for command in commands} - {""} == {"queue", "overwrite"}
    assert {command.start for command in commands} - {""} == {"desired", "observed"}
    assert {command.only_own for command in commands} == {False, True}
    assert any(command.times for command in commands)
    assert any(len(command.actuators) > 1 for command in commands)
    assert {entry.status for entry in entries} - {None} == {
        *("active", "completed", "overwritten", "purged", "interrupted"),
        *("rejected", "halted"),
    }
    assert "unknown" not in {command.kind for command in commands}


@pytest.mark.parametrize("name", JOURNALS)
def test_a_recording_of_an_earlier_version_is_played(name: str, segment: str) -> None:
    path, prefix = RECORDINGS / f"{name}.mcap", f"{segment}-"
    (*_, run) = o80.open(path)["joints"].epochs
    with o80.play(path, ["joints"], prefix=prefix, speed=math.inf) as playback:
        assert playback.wait(WAIT)
        with o80.Frontend(f"{prefix}joints", dead=True) as arm:
            assert repr(arm.journal()) == repr(run.journal()[:-1])  # without its end
