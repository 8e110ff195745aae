"""Draws a throw in the images of four synthetic cameras, and the flight that the tracker finds.

python -m o80_devices.ball_tracking.picture tracking.png
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from o80.base.descriptors import open_standard_streams
from o80.base.extras import needed
from o80_devices.ball_tracking.tracker import Tracker
from o80_devices.cameras.rig import four_cameras
from o80_devices.cameras.scene import Scene
from o80_devices.cameras.throws import FLIGHT, Throws

RATE = 180.0
SHOWN = 0.55  # the moment whose images are drawn [s]


def draw(path: str) -> None:
    """Writes the picture. Raises MissingExtra without matplotlib."""
    purpose = "a picture"
    matplotlib: Any = needed("matplotlib", "plot", purpose)
    matplotlib.use("Agg")
    plots: Any = needed("matplotlib.pyplot", "plot", purpose)
    rig = four_cameras()
    scene, throws, tracker = Scene(rig), Throws(rig, 1), Tracker(rig)
    rows, images, marks = [], [], np.empty((0, 4))
    for i in range(round(FLIGHT * RATE)):
        ball = throws.at(i / RATE)
        seen = [scene.image(k, ball.position, ball.velocity) for k in range(4)]
        tracked = tracker.track(seen, round(i / RATE * 1e9))
        rows.append((i / RATE, ball, tracked))
        if i == round(SHOWN * RATE):
            images, marks = seen, tracker.sightings

    figure, axes = plots.subplots(2, 3, figsize=(12, 5.6), layout="constrained")
    for k, axis in enumerate(axes[:, :2].ravel()):
        axis.imshow(images[k])
        own = marks[marks[:, 0] == k]
        axis.plot(own[:, 1], own[:, 2], "o", mfc="none", mec="yellow", ms=14)
        axis.set_title(rig.cameras[k].name, fontsize=9)
        axis.set_axis_off()
    found = [(time, ball, tracked) for time, ball, tracked in rows if tracked.seen]
    times = [time for time, _, _ in found]
    axes[0, 2].plot([r[0] for r in rows], [r[1].position[2] for r in rows], label="true height")
    axes[0, 2].plot(times, [t.position[2] for _, _, t in found], "--", label="tracked")
    axes[0, 2].set(xlabel="time [s]", ylabel="height [m]")
    axes[0, 2].legend()
    apart = [1e3 * np.linalg.norm(t.position - b.position) for _, b, t in found]
    axes[1, 2].plot(times, apart, label="error")
    axes[1, 2].plot(times, [1e3 * t.error for _, _, t in found], "--", label="as the filter says")
    axes[1, 2].set(xlabel="time [s]", ylabel="[mm]", ylim=(0, 6))
    axes[1, 2].legend()
    figure.savefig(path, dpi=90)


if __name__ == "__main__":
    open_standard_streams()
    draw(sys.argv[1] if len(sys.argv) > 1 else "tracking.png")
