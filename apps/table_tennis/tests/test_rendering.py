"""Pictures come without a screen, whoever imported MuJoCo first."""

import os
import subprocess
import sys

import numpy as np
import pytest

from o80_table_tennis.report.rendering import Scene

DRAW = """
import numpy as np
from o80_table_tennis.report.rendering import Scene
with Scene() as scene:
    picture = scene.draw(np.zeros(4), np.array([[0.4, 1.5, 1.0]]))
print(picture.shape, picture.std() > 1)
"""


@pytest.mark.check
@pytest.mark.parametrize("before", ["", "import mujoco"])
def test_a_scene_is_drawn_without_a_screen(before: str) -> None:
    quiet = {k: v for k, v in os.environ.items() if k not in ("MUJOCO_GL", "DISPLAY")}
    done = subprocess.run(
        [sys.executable, "-c", before + DRAW],
        env=quiet,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "(480, 640, 3) True"


@pytest.mark.check
def test_an_unknown_camera_is_refused_with_those_there_are() -> None:
    with (
        Scene() as scene,
        pytest.raises(ValueError, match="'top'; there are: side, behind, close"),
    ):
        scene.draw(np.zeros(4), np.zeros((1, 3)), camera="top")
