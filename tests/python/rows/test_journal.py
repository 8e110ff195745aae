"""Decisions of the backend, also about commands of others, and how it was started."""

import contextlib
import json
import os
from pathlib import Path

import numpy as np
from manual_backend import ManualBackend
from processes import Running, run_o80

import o80
from o80.base.installation import prefix
from o80.frontend.reader import Journal
from o80.rows.journal import JournalEntry


def of_kind(entries: list[JournalEntry], *kinds: str) -> list[JournalEntry]:
    return [entry for entry in entries if entry.kind in kinds]


def test_targets_have_the_fields_that_were_given(segment: str) -> None:
    joint = np.dtype([("position", "f8"), ("gains", "f8", (2,)), ("enabled", "?")])
    with ManualBackend(segment, ["a", "b"], joint) as robot:
        robot.frontend.add_command("a", {"position": 0.25})
        robot.desired("b", {"gains": [1.0, 2.0], "enabled": True})
        first, second = of_kind(robot.frontend.journal(), "taken")[0].commands
    assert first.targets == ({"position": 0.25},)
    (target,) = second.targets
    assert set(target) == {"gains", "enabled"}
    assert target["gains"].tolist() == [1.0, 2.0]
    assert target["enabled"] is True


def test_goes_on_behind_the_entries_that_were_read(segment: str) -> None:
    with ManualBackend(segment, ["a"]) as robot:
        journal, new = Journal(robot.frontend), Journal(robot.frontend, new=True)
        seen: list[int] = []
        for target in range(5):
            robot.desired("a", float(target))
            entries = journal.read()
            assert [entry.missed for entry in entries] == [0] * len(entries)
            assert entries == new.read()
            assert entries == robot.frontend.journal(since=seen[-1] + 1 if seen else None)
            seen += [entry.number for entry in entries]
        assert journal.read() == []
        assert len(of_kind(robot.frontend.journal(), "taken")) == 5
        assert sorted(set(seen)) == seen


def test_of_a_backend_that_has_failed_the_journal_is_still_there(segment: str) -> None:
    with contextlib.suppress(ValueError), o80.Backend(segment, ["a"]) as backend:
        backend.publish()
        raise ValueError("it broke")
    with o80.Frontend(segment, dead=True) as late:
        assert late.journal()[-1].kind == "ended"
        assert "it broke" in late.journal()[-1].text


def test_there_is_nothing_after_the_newest_entry(arm: o80.Frontend) -> None:
    assert arm.journal(since=2**80) == []


def test_of_a_backend_in_a_program_has_its_options(segment: str) -> None:
    with o80.Backend(segment, ["a"], robot="gripper", frequency=100, journal=0) as backend:
        backend.publish([0.0])
        with o80.Frontend(segment) as frontend:
            found = frontend.provenance
    assert found.robot == "gripper"
    assert found.library == ""
    assert found.options == {}
    assert found.run_options["frequency"] == "100"
    assert found.run_options["journal"] == "0"


def test_reads_back_from_json(arm: o80.Frontend) -> None:
    found = arm.provenance

    assert o80.Provenance.from_json(found.as_json()) == found
    later = json.loads(found.as_json()) | {"of_a_later_version": 1}
    assert o80.Provenance.from_json(json.dumps(later)) == found


def test_keeps_texts_that_are_not_utf_8(segment: str, tmp_path: Path) -> None:
    library = Path(os.fsdecode(bytes(tmp_path) + b"/two\xff\njoints.so"))
    library.write_bytes(o80.robots.load("two_joints").path.read_bytes())
    with (
        Running(prefix() / "bin" / "o80-run", library, f"--segment={segment}"),
        o80.Frontend(segment, timeout=30, read_only=True) as arm,
    ):
        found = arm.provenance
        told = run_o80("info", segment).stdout
    assert Path(found.library) == library
    assert o80.Provenance.from_json(found.as_json()) == found
    assert "two??joints.so" in told
