"""Fixtures: robots, and unique segment names."""

import itertools
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import o80

_count = itertools.count()


@pytest.fixture
def segment() -> Iterator[str]:
    """Returns a unique name, and removes a leftover segment afterwards."""
    name = f"test-{os.getpid()}-{next(_count)}"
    yield name
    if any(entry.name == name and not entry.alive for entry in o80.segments()):
        o80.clean(name)


@pytest.fixture
def forged(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Fields that replace the provenance in this test's recordings."""
    given: dict[str, Any] = {}
    as_json = o80.Provenance.as_json
    monkeypatch.setattr(
        o80.Provenance, "as_json", lambda self: json.dumps(json.loads(as_json(self)) | given)
    )
    return given


@pytest.fixture
def arm(segment: str) -> Iterator[o80.Frontend]:
    """Two joints inside this process: shoulder and elbow, each limited to 3 rad."""
    with o80.robots.load("two_joints").inline(segment) as frontend:
        yield frontend


@pytest.fixture
def process(segment: str) -> Iterator[o80.robots.Process]:
    """Two joints in another process, 1000 iterations a second."""
    with o80.robots.load("two_joints").start(segment) as started:
        yield started


@pytest.fixture
def bursting(segment: str) -> Iterator[o80.robots.Process]:
    """Two joints in another process, in bursting mode."""
    with o80.robots.load("two_joints").start(segment, bursting=True) as started:
        yield started


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """File in which a test records."""
    return tmp_path / "run.mcap"


@pytest.fixture
def recorded(segment: str, path: Path) -> Path:
    """A recording of a moving arm of two joints, named as the test's segment: 201 rows."""
    with o80.robots.load("two_joints").inline(segment) as arm, o80.Recording(path, arm) as file:
        arm.add_command("elbow", 0.5, iterations=100)
        arm.burst(150)
        file.flush()
        arm.burst(50)
    return path
