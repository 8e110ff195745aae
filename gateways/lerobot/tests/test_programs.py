"""LeRobot's own programs record, replay and teleoperate robots of o80."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from starting import Start

import o80

pytestmark = pytest.mark.check

JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
# one after the other in one process, as each takes ten seconds to import what it needs
ALL = """
import json, sys
from importlib import import_module
for program, words in json.loads(sys.argv[1]):
    sys.argv = [program, *words]
    import_module("lerobot.scripts.lerobot_" + program).main()
"""
MOVED = 200 * 360 / 4095  # of the leader [deg]


def run(home: Path, command: list[str]) -> None:
    own = {"HF_HOME": str(home), "HF_LEROBOT_HOME": str(home), "HF_HUB_OFFLINE": "1"}
    done = subprocess.run(
        command, env=os.environ | own, capture_output=True, text=True, timeout=250
    )
    assert done.returncode == 0, done.stderr[-3000:]


@pytest.mark.parametrize("robot", ["so101", "so101_twin"])
def test_they_record_replay_and_teleoperate(
    robot: str, start: Start, leader: str, tmp_path: Path
) -> None:
    follower = start(robot)
    to = ["--robot.type=o80", f"--robot.segment={follower}", "--robot.timeout=60"]
    by = ["--teleop.type=o80", f"--teleop.segment={leader}", "--teleop.timeout=60"]
    of = [
        "--dataset.repo_id=o80/waves",
        f"--dataset.root={tmp_path / 'set'}",
        "--play_sounds=false",
    ]
    record = "single_task=wave num_episodes=2 episode_time_s=1 reset_time_s=0 push_to_hub=false"
    programs = [
        ("record", [*to, *by, *of, *(f"--dataset.{each}" for each in record.split())]),
        ("replay", [*to, *of, "--dataset.episode=1"]),
        ("teleoperate", [*to, *by, "--teleop_time_s=1", "--fps=30"]),
    ]
    with o80.Frontend(follower) as arm:
        if robot == "so101":
            for program, words in programs:
                run(tmp_path, [f"{sys.prefix}/bin/lerobot-{program}", *words])
        else:
            run(tmp_path, [sys.executable, "-c", ALL, json.dumps(programs)])
        arm.keep_alive()  # control was given back
        senders = [each.sender for each in arm.journal() if each.kind == "control_released"]
        desired = arm.latest().desired
    assert len(senders) == 3
    assert np.degrees(desired.joints) == pytest.approx([MOVED] * 5, abs=0.1)

    recorded = LeRobotDataset("o80/waves", root=tmp_path / "set")
    assert (recorded.num_episodes, recorded.fps) == (2, 30)
    for name in ("action", "observation.state"):
        assert recorded.features[name]["names"] == [f"{joint}.pos" for joint in JOINTS]
    last = recorded[len(recorded) - 1]
    assert last["action"].numpy()[:5] == pytest.approx([MOVED] * 5, abs=0.1)
    assert last["observation.state"].numpy()[:5] == pytest.approx([MOVED] * 5, abs=2.0)
