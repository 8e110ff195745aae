"""The arm that the tests of this folder share."""

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from fake_so101 import FakeArm


@pytest.fixture
def arm(tmp_path: Path) -> Iterator[FakeArm]:
    with ExitStack() as stack:
        yield FakeArm(tmp_path, stack)
