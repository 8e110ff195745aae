"""Provenance: what a segment says about how its backend was started."""

import json
import os
import subprocess
from pathlib import Path

from processes import run_o80

import o80
from o80.base.installation import prefix


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
    popen = subprocess.Popen(
        [prefix() / "bin" / "o80-run", library, f"--segment={segment}", "--until-eof"],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
    )
    try:
        with o80.Frontend(segment, timeout=30, read_only=True) as arm:
            found = arm.provenance
        told = run_o80("info", segment).stdout
    finally:
        popen.communicate()
    assert Path(found.library) == library
    assert o80.Provenance.from_json(found.as_json()) == found
    assert "two??joints.so" in told
