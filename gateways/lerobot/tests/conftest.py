"""Robots that LeRobot drives."""

from collections.abc import Iterator

import pytest
from starting import Start, starting


@pytest.fixture
def start() -> Iterator[Start]:
    with starting() as start:
        yield start


@pytest.fixture(scope="session")
def leader() -> Iterator[str]:
    """An arm that a hand has led 200 steps away from the middle."""
    with starting() as start:
        yield start("so101_leader", moved=200)
