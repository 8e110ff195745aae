"""Robots that LeRobot drives."""

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
    """An arm that a hand has led 200 steps away from the middle."""
    with starting() as start:
        yield start("so101_leader", moved=200)
