"""Reads the recordings in this folder with Rerun: `pip install rerun-sdk`, then run this file.

No other test needs Rerun, which takes 500 MB.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
RERUN = Path(sys.executable).with_name("rerun")


def output_of(*words: str | Path) -> str:
    done = subprocess.run([RERUN, *words], capture_output=True, text=True, check=True)
    return done.stdout + done.stderr


def read(path: Path) -> None:
    checked = output_of("mcap", "check", path)
    for topic in ("/joints", "/joints/joint_states", "/joints/journal", "/o80/marks"):
        line = next(line for line in checked.splitlines() if f" {topic} " in line)
        assert line.startswith("ok "), checked
    with tempfile.TemporaryDirectory() as folder:
        converted = Path(folder) / "run.rrd"
        said = output_of("mcap", "convert", path, "-o", converted)
        assert "ERROR" not in said, said
        assert "multiple MCAP metadata records" not in said, said
        stats = output_of("rrd", "stats", converted)
    # Rerun's own decoder of joint states has read them
    assert "/joints/joint_states/position" in stats, stats
    print(f"{path.name}: read by Rerun")


if __name__ == "__main__":
    for each in sorted(HERE.glob("*.mcap")):
        read(each)
