"""A replay loads and reads only what the user trusts: a recording may come from a stranger."""

import hashlib
import os
import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

import o80
from o80.replaying.recorded_run import FileRun, LiveRun, runs_in
from o80.replaying.replay import RunReplay
from o80.replaying.trust import options_of
from o80.rows.provenance import Provenance, ProvenanceFile


@pytest.fixture
def stray(tmp_path: Path) -> Path:
    """A library that no one has installed."""
    path = tmp_path / "stray.so"
    shutil.copy(o80.robots.path_of("two_joints"), path)
    return path


def is_loaded(library: Path) -> bool:
    return str(library) in Path("/proc/self/maps").read_text()


def test_a_library_that_only_the_recording_names_is_not_loaded(
    stray: Path, forged: dict[str, Any], request: pytest.FixtureRequest
) -> None:
    forged["library"] = str(stray)
    path = request.getfixturevalue("recorded")

    report = o80.replay(path)  # with the robot of this name that is installed here
    assert report.identical, report
    assert not is_loaded(stray)

    (named,) = o80.replay(path, robot={"two_joints": stray})
    assert named.identical, named
    assert is_loaded(stray)


@dataclass(frozen=True)
class Forged:
    """A recorded run whose schema and provenance say something else."""

    run: FileRun
    schema: dict[str, Any]
    provenance: Provenance

    def __getattr__(self, name: str) -> Any:
        return getattr(self.run, name)


@pytest.fixture
def run(recorded: Path) -> FileRun:
    return runs_in(o80.open(recorded))[0]


def test_a_recorded_name_is_not_taken_for_a_path(run: FileRun, stray: Path) -> None:
    for name in (str(stray), os.path.relpath(stray), "../stray.so"):
        forged = Forged(run, run.schema | {"robot": name}, run.provenance)
        with pytest.raises(o80.DriverError, match="may name any library") as refused:
            RunReplay(forged).report()  # type: ignore[arg-type]
        assert "--robot" in str(refused.value)
    assert not is_loaded(stray)


class Described:
    """Stands for a robot of another package, which has an option that names a file."""

    options = (o80.robots.Option(name="model", kind="text", default="", help="", unit=""),)


def checked(run: FileRun, text: str, files: tuple[ProvenanceFile, ...] = (), **given: str) -> Any:
    forged = replace(run.provenance, options={"model": text}, files=files)
    return options_of(Forged(run, run.schema, forged), Described(), given)["model"]  # type: ignore[arg-type]


def test_a_recorded_file_is_read_only_with_its_recorded_content(
    run: FileRun, tmp_path: Path
) -> None:
    file = tmp_path / "model.xml"
    file.write_text("<mujoco/>")
    with pytest.raises(o80.InvalidArgument, match="has another content here"):
        checked(run, str(file), (ProvenanceFile("model", str(file), "0" * 64),))
    with pytest.raises(o80.InvalidArgument, match="--set model=FILE"):
        checked(run, str(file))
    assert checked(run, str(file), model="mine.xml") == "mine.xml"

    sha = hashlib.sha256(file.read_bytes()).hexdigest()
    known = (ProvenanceFile("model", str(file), sha),)
    assert checked(run, str(file), known) == str(file)
    assert checked(run, "model.xml", known) == str(file)  # as recorded in another folder


def test_a_device_or_a_pipe_is_not_opened(run: FileRun, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in ("/dev/zero", str(tmp_path / "pipe"), "~/.ssh/id_rsa", "../../x", "/nowhere/x"):
        with pytest.raises(o80.InvalidArgument, match="may name any file"):
            checked(run, path, (ProvenanceFile("model", path, "0" * 64),))
        with pytest.raises(o80.InvalidArgument, match="may name any file"):
            checked(run, path)


def test_texts_that_are_no_files_are_kept(run: FileRun) -> None:
    for text in ("hill", "a,b", "arm/elbow"):
        assert checked(run, text) == text


def test_the_user_of_a_robot_in_shared_memory_may_change_its_files(segment: str) -> None:
    with o80.robots.load("two_joints").inline(segment) as arm:
        arm.burst(3)
        assert LiveRun(arm).is_own


def test_a_segment_that_is_played_is_as_foreign_as_its_recording(
    recorded: Path, segment: str
) -> None:
    with o80.play(recorded, speed=float("inf")) as playback:
        playback.wait()
        with o80.Frontend(segment, read_only=True) as arm:
            assert not LiveRun(arm).is_own
            assert o80.replay(arm).identical
