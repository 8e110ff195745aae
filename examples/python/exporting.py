"""Records marked episodes and exports them as a data set for learning.

Needs the extras `record` and `export` (pip install "o80[record,export]").
"""

import tempfile
from pathlib import Path

import o80
from o80.datasets import lerobot
from o80.datasets.episodes import episodes_of

with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "run.mcap"

    with o80.robots.load("two_joints").inline() as arm, o80.Recording(path, arm) as recording:
        for number in range(5):
            arm.request("reset", seed=number)
            arm.burst(1)
            recording.mark("episode", task="swing the elbow", number=number)
            arm.add_command("elbow", 0.1 * number, iterations=50)
            reached = arm.burst(50).observed[1]
            recording.mark("episode_end", reward=float(reached))

    # a step of the data set is ten iterations
    episodes = episodes_of(o80.open(path), every=10)
    for episode in episodes.all:
        print(
            f"episode {episode.values['number']}: {len(episode)} steps, {episode.rewards[-1]:.2f}"
        )

    lerobot.write(Path(folder) / "swings", episodes)
    for file in sorted((Path(folder) / "swings").rglob("*.*")):
        print(file.relative_to(folder))
