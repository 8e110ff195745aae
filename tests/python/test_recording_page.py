"""The programs of docs/recording.md run as they stand there."""

import re
import subprocess
import sys
from pathlib import Path

PAGE = Path(__file__).resolve().parents[2] / "docs" / "recording.md"


def test_the_programs_run_one_after_the_other(tmp_path: Path) -> None:
    outputs = []
    for program in re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL):
        done = subprocess.run(
            [sys.executable, "-c", program],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=60,
        )
        assert done.returncode == 0, done.stderr
        outputs.append(done.stdout)

    assert len(outputs) >= 4
    assert "151 (151, 2) []" in outputs[1]
    assert "('episode', {'number': 2}" in outputs[1]
