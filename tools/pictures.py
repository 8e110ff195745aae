"""Redraws the pictures of docs: docs/pictures/*.png. Needs tools of make check.

python tools/pictures.py
"""

from pathlib import Path
from typing import Any

from matplotlib.image import imsave

import o80
from chromium import Chromium
from motion_pictures import draw_paces, draw_streaming
from o80.plot import plot
from o80.rows.journal import command_ends
from o80_table_tennis.world.scene import MODEL

FOLDER = Path(__file__).resolve().parent.parent / "docs" / "pictures"
VIEW_SIZE = (1180, 700)


def draw_so101(path: Path) -> None:
    """Draws the simulated SO-101 in the middle of a large picture."""
    twin = o80.robots.load("so101_twin")
    with twin.inline() as arm, o80.Pictures(arm, size=(1600, 1000), model_files=True) as pictures:
        for joint, place in {"shoulder_pan": 0.7, "shoulder_lift": 0.2, "elbow_flex": -0.5}.items():
            arm.add_command(joint, place, duration=1.0)
        arm.add_command("wrist_flex", 0.9, duration=1.0)
        arm.add_command("gripper", 0.5, duration=1.0)
        imsave(path, pictures.draw(arm.burst(300))[230:680, 340:980])


def draw_recording(path: Path) -> None:
    """Draws the recording of a motion with a halt."""
    with o80.robots.load("two_joints").inline() as arm:
        arm.add_command("elbow", 0.5, duration=0.2)
        arm.add_command("shoulder", 0.4, duration=0.3, profile="minimum_jerk")
        arm.burst(250)
        arm.halt("enough")
        arm.burst(100)
        arm.resume()
        arm.add_command("elbow", -0.2, duration=0.2)
        arm.burst(300)
        name = arm.segment
        ends = {name: command_ends(arm.journal())}
        plot({name: arm.history()}, ends=ends).savefig(path, dpi=80)


def draw_view(path: Path) -> None:
    """Draws the page of o80 view: a swinging arm beside flying balls."""
    options: dict[str, Any] = {
        "model": str(MODEL),
        "balls": "ball",
        "extra_balls": 5,
        "surfaces": "table",
    }
    balls = ["ball", *(f"ball_{i}" for i in range(1, 6))]
    joints = ["joint_1", "joint_2", "joint_3", "joint_4"]
    with (
        o80.robots.load("mujoco").inline("twin", **options) as twin,
        o80.View(twin) as view,
        Chromium() as browser,
    ):
        for i, ball in enumerate(balls):
            place = [0.1 + 0.12 * i, 2.9 - 0.2 * i, 1.2]
            twin.add_command(ball, {"position": place, "velocity": [0.0, -3.0, 1.5]})
        for joint, target in zip(joints, (0.7, 1.0, 0.6, -0.4), strict=True):
            twin.add_command(joint, target, iterations=110, profile="minimum_jerk")
            twin.add_command(joint, -0.5 * target, iterations=200, profile="minimum_jerk")
        twin.burst(200)
        page = browser.page(view.url, *VIEW_SIZE)
        page.wait_for("page.scene.frames > 0 && page.charts.length")
        page.value(
            "void Object.assign(page.scene, {azimuth: -0.75, elevation: 0.36, distance: 4.8})"
        )
        page.value("page.scene.dirty = true")
        looks = page.value("page.looks")
        page.wait_for(f"page.looks > {looks} + 8 && page.charts[2].parts.observed")
        path.write_bytes(page.picture())


if __name__ == "__main__":
    draw_so101(FOLDER / "so101.png")
    draw_recording(FOLDER / "recording.png")
    draw_view(FOLDER / "view.png")
    draw_paces(FOLDER / "paces.png")
    draw_streaming(FOLDER / "streaming.png")
