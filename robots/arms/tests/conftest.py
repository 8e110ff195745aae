"""The arms that the tests of this folder share."""

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from fake_arm import FakeArm


@pytest.fixture
def arm(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[FakeArm]:
    """An SO-101, or the arm of the name that a test gives."""
    with ExitStack() as stack:
        yield FakeArm(tmp_path, stack, getattr(request, "param", "so101"))
