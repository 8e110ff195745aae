"""Records a run, repeats it bit for bit, and finds the first difference of a changed robot.

Needs the extra `record` (pip install "o80[record]").
"""

import tempfile
from pathlib import Path

import o80

with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "run.mcap"

    robot = o80.robots.load("two_joints")
    with robot.inline("arm", gain=12.0) as arm, o80.Recording(path, arm):
        arm.add_command("elbow", 0.5, iterations=100)
        arm.burst(40)
        arm.add_command("elbow", -0.2, iterations=60, mode="overwrite")
        arm.burst(100)

    # the robot is started again with the recorded options, and given the recorded commands
    report = o80.replay(path)
    print(report)
    assert report.identical

    # the same commands for a robot with another gain
    report = o80.replay(path, options={"gain": 12.5})
    print(report)
    assert report.difference is not None
    print(f"the first difference is in iteration {report.difference.iteration}")
