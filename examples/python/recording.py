"""Records a robot while a program moves it, and reads the recording again.

Needs the extra `record` (pip install "o80[record]").
"""

import tempfile
from pathlib import Path

import o80

with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "run.mcap"

    with o80.robots.load("two_joints").inline() as arm, o80.Recording(path, arm) as recording:
        for episode in range(3):
            recording.mark("episode", number=episode)
            arm.add_command("elbow", 0.1 * episode, iterations=50)
            arm.burst(50)
        name = arm.segment

    file = o80.open(path)
    history = file[name].history()
    print(f"{len(history)} rows, the last at {history.time[-1] * 1e-9:.3f} s")
    for mark in file.marks:
        row = history.at_iteration(mark.rows[name])
        print(
            f"{mark.name} {mark.values['number']}: begins with the elbow at {row.observed[1]:.3f}"
        )
