"""Plays a recording: a program for a robot reads the recording without a change.

Needs the extra `record` (pip install "o80[record]").
"""

import tempfile
from pathlib import Path

import o80


def highest_elbow(segment: str) -> float:
    """Reads a robot to its end; the same code serves a running robot and a recording."""
    highest = 0.0
    with o80.Frontend(segment) as arm:
        try:
            while True:
                highest = max(highest, float(arm.burst(1).observed[1]))
        except o80.BackendStopped:
            return highest


with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "run.mcap"

    with o80.robots.load("two_joints").inline("arm") as arm, o80.Recording(path, arm):
        arm.add_command("elbow", 0.5, iterations=100)
        arm.add_command("elbow", 0.1, iterations=100)
        arm.burst(200)

    # by bursts: each row waits for the reader
    with o80.play(path, bursts=True):
        print(f"the elbow was at {highest_elbow('arm'):.3f}")

    # all rows at once, under another name
    with o80.play(path, speed=float("inf"), prefix="old-") as playback:
        playback.wait()
        with o80.Frontend("old-arm") as arm:
            print(f"{len(arm.history())} rows of {arm.robot}, played: {arm.played}")
