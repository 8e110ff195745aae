"""Processor time of tracking a ball in four images of 640 x 480 pixels, at 180 Hz.

The images and their noise are prepared; those of a flight follow those of an empty room, so that
following and searching are both measured. The images come as rows of a segment, as in real time.
"""

import time

import numpy as np
from numpy.typing import NDArray

import o80
from o80_devices.ball_tracking import Tracker, four_cameras
from o80_devices.cameras.image_source import ImageSource
from o80_devices.cameras.scene import Scene
from o80_devices.cameras.throws import FLIGHT, Throws
from sampling import rounds, sample, seconds

RATE = 180.0
EVERY = 6  # images that are prepared are this many periods apart
NAME = "bench-ball-tracking"


def prepared() -> list[NDArray[np.uint8]]:
    """(4, bytes) Rows of images: a flight, then nothing."""
    rig = four_cameras()
    scene, throws = Scene(rig), Throws(rig, 1)
    rows = []
    for i in range(round((FLIGHT + 0.2) * RATE / EVERY)):
        ball = throws.at(i * EVERY / RATE)
        place = ball.position if ball.number else None
        rows.append(np.stack([scene.image(k, place, ball.velocity).ravel() for k in range(4)]))
    return rows


def measure(rows: list[NDArray[np.uint8]]) -> None:
    rig = four_cameras()
    extended = {"capture_time": np.int64, "images": (np.uint8, rows[0].shape)}
    tracker, source = Tracker(rig), ImageSource([NAME], rig, 0.001)
    used, found = 0.0, 0
    with o80.Backend(NAME, 0, extended=extended, frequency=RATE / EVERY, history=4) as backend:
        for i, images in enumerate(rows):
            now = 1 + round(i * EVERY / RATE * 1e9)
            if i:
                backend.step()
            backend.publish(None, {"capture_time": now, "images": images})
            if i == 0:
                source.attach(1.0)
            begin = time.process_time()
            seen = source.read(0.0)
            assert seen is not None
            found += tracker.track(seen.images, seen.time).seen
            used += time.process_time() - begin
        source.close()
    assert found > len(rows) / 2, "the ball was not followed"
    sample("ball_tracking", "%", 100 * RATE * used / len(rows))


def rendering() -> float:
    """Time to render four synthetic images of a flying ball [s]: no part of the tracker."""
    rig = four_cameras()
    scene, throws = Scene(rig), Throws(rig, 1)
    images = [np.empty((480, 640, 3), np.uint8) for _ in rig.cameras]
    balls = [throws.at(i / RATE) for i in range(60)]
    begin = time.process_time()
    for ball in balls:
        for k, image in enumerate(images):
            scene.image(k, ball.position, ball.velocity, image)
    return (time.process_time() - begin) / len(balls)


def main() -> None:
    rows = prepared()
    sample("ball_images_rendered", "%", 100 * RATE * rendering())
    for _ in range(rounds()):
        measure(rows)
        copied = [seconds(rows[0].copy) for _ in range(20)]
        sample("ball_images_copied", "%", 100 * RATE * float(np.median(copied)))


if __name__ == "__main__":
    main()
