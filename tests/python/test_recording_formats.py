"""Recordings that earlier versions of o80 wrote are read as they were then."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import o80

RECORDINGS = Path(__file__).resolve().parents[1] / "data" / "recordings"


@pytest.mark.parametrize("name", [path.stem for path in sorted(RECORDINGS.glob("*.mcap"))])
def test_a_recording_of_an_earlier_version_is_read(name: str) -> None:
    expected = json.loads((RECORDINGS / f"{name}.json").read_text())
    recording = o80.open(RECORDINGS / f"{name}.mcap")
    (segment,) = recording.segments.values()

    assert recording.finished
    assert [(mark.name, mark.values) for mark in recording.marks] == [
        (mark["name"], mark["values"]) for mark in expected["marks"]
    ]
    assert len(segment.epochs) == len(expected["epochs"])
    for epoch, there in zip(segment.epochs, expected["epochs"], strict=True):
        history = epoch.history()
        for part in ("iteration", "time", "desired", "observed", "halted"):
            assert np.array_equal(getattr(history, part), there[part]), part
        assert np.array_equal(history.extended.effort, there["effort"])
        assert epoch.gaps == epoch.journal_gaps == []
        assert epoch.provenance.robot == "two_joints"
        assert epoch.provenance.options == there["options"]
        assert [
            [entry.number, entry.kind, entry.iteration, len(entry.commands), entry.text]
            for entry in epoch.journal()
        ] == there["journal"]


@pytest.mark.parametrize("name", [path.stem for path in sorted(RECORDINGS.glob("*.mcap"))])
def test_a_recording_of_an_earlier_version_is_replayed(name: str) -> None:
    command = [str(Path(sys.executable).parent / "o80"), "replay", f"{name}.mcap"]
    done = subprocess.run(command, cwd=RECORDINGS, capture_output=True, text=True, timeout=60)

    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("116 rows, identical") == 2
