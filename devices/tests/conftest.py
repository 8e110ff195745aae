"""Segment names of their own for the tests of the package."""

import itertools
import os
from collections.abc import Iterator

import pytest

import o80

_count = itertools.count()


@pytest.fixture
def segment() -> Iterator[str]:
    """A name that no other test uses; what is left of it is removed."""
    name = f"test-{os.getpid()}-devices-{next(_count)}"
    yield name
    if any(entry.name == name and not entry.alive for entry in o80.segments()):
        o80.clean(name)
