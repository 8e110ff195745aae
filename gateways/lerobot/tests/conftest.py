"""Fixtures: robots for LeRobot's programs."""

import os
from collections.abc import Iterator

import pytest
from starting import Start, starting

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before torch: its threads spin on busy processors


@pytest.fixture
def start() -> Iterator[Start]:
    with starting() as start:
        yield start


@pytest.fixture(scope="session")
def leader() -> Iterator[str]:
    """Starts a leader 200 steps away from the middle."""
    with starting() as start:
        yield start("so101_leader", moved=200)
