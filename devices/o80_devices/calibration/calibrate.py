"""The command that calibrates a rig of cameras.

python -m o80_devices.calibration.calibrate lenses boards/ --board 9x6 --square 0.03
python -m o80_devices.calibration.calibrate pictures --segment video_cameras
python -m o80_devices.calibration.calibrate wave --segment video_cameras
python -m o80_devices.calibration.calibrate places --corners corners.json
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

import numpy as np

import o80
from o80.base.arrays import FloatArray
from o80.base.screen import keep_printing
from o80.errors import InvalidArgument, TimeoutError
from o80_devices.ball_tracking import colour
from o80_devices.calibration import board as boards
from o80_devices.calibration import bundle, extrinsics, lenses
from o80_devices.calibration.table_corners import TableCorners
from o80_devices.calibration.waved_ball import BallFinder, WavedBall, collected
from o80_devices.calibration.world_frame import left_out_errors
from o80_devices.cameras.image_source import ImageSource
from o80_devices.cameras.rig import Rig, RigCamera

ATTACHING = 10.0
"""Timeout of the attachment to the cameras' segment [s]."""
SKEW = 0.002
"""Longest time between images that count as simultaneous [s]."""


def progress(text: str) -> None:
    print(f"\r{text:70}", end="", file=sys.stderr, flush=True)


def source_of(segments: str, cameras: Sequence[RigCamera]) -> ImageSource:
    """Attaches to running cameras. Raises TimeoutError, InvalidArgument (no segment, no images)."""
    names = [name.strip() for name in segments.split(",") if name.strip()]
    if not names:
        raise InvalidArgument("name the segments of the cameras: --segment video_cameras")
    source = ImageSource(names, Rig(tuple(cameras)), SKEW)
    source.attach(ATTACHING)
    return source


# ---------------------------------------------------------------------- lenses


def calibrate_lenses(given: argparse.Namespace) -> None:
    board = boards.Board(given.board, given.square)
    if given.folder is None:
        found = live_lenses(given, board)
    else:
        pictures = boards.pictures_of(given.folder)
        found = [lenses.lens_from_files(name, files, board) for name, files in pictures.items()]
    print("camera           pictures  focal length [px]   fitted [px]  held out [px]")
    for lens in found:
        focal = "{:.1f} {:.1f}".format(*lens.camera.focal)
        print(
            f"{lens.camera.name:16} {lens.pictures:8}  {focal:17}  {lens.fitted:12.3f}"
            f"  {lens.held_out:13.3f}"
        )
    lenses.save(found, given.output)
    print(f"written: {given.output}")


def live_lenses(given: argparse.Namespace, board: boards.Board) -> list[lenses.Lens]:
    names = [name.strip() for name in given.names.split(",") if name.strip()]
    if not given.segment or not names:
        raise InvalidArgument(
            "give a folder of pictures, or --segment and --names (of its cameras, in their order)"
        )
    cameras = [RigCamera(name, given.size, (1.0, 1.0), (0.0, 0.0)) for name in names]
    count = max(given.pictures, lenses.MIN_FOUND)
    with closing(source_of(given.segment, cameras)) as source:
        found = lenses.boards_from_segments(source, cameras, board, count, say=progress)
    print(file=sys.stderr)
    return [
        lenses.lens_from_boards(camera.name, camera.size, seen, board, of=len(seen))
        for camera, seen in zip(cameras, found, strict=True)
    ]


# ---------------------------------------------------------------------- a picture of each camera


def save_pictures(given: argparse.Namespace) -> None:
    cameras = lenses.load(given.lenses)
    missing = {camera.name for camera in cameras}
    with closing(source_of(given.segment, cameras)) as source:
        given.output.mkdir(parents=True, exist_ok=True)
        end = time.monotonic() + ATTACHING
        while missing:
            source.wait(0.1)
            images = source.read()
            for camera, image in zip(cameras, images.images if images else [], strict=False):
                if image is not None and camera.name in missing:
                    file = given.output / f"{camera.name}.png"
                    boards.opencv().imwrite(str(file), image[..., ::-1])
                    missing.discard(camera.name)
            if missing and time.monotonic() > end:
                raise TimeoutError(f"no image came from {', '.join(sorted(missing))}")
    print(f"written: {len(cameras)} pictures in {given.output}")


# ---------------------------------------------------------------------- the waved ball


def record_wave(given: argparse.Namespace) -> None:
    if given.moments < 1:
        raise InvalidArgument(f"--moments must be positive, got {given.moments}")
    cameras = lenses.load(given.lenses)
    colours = colour.load(given.colours) if given.colours else None
    with closing(source_of(given.segment, cameras)) as source:
        waved = collected(
            source,
            [camera.name for camera in cameras],
            given.moments,
            finder=BallFinder(colours),
            say=lambda count: progress(f"{count} of {given.moments} moments"),
        )
    print(file=sys.stderr)
    for camera, seen in zip(cameras, np.isfinite(waved.pixels).all(-1).sum(0), strict=True):
        print(f"{camera.name:16} saw the ball in {seen} moments")
    waved.save(given.output)
    print(f"written: {given.output}")


# ---------------------------------------------------------------------- places


def calibrate_places(given: argparse.Namespace) -> None:
    cameras = lenses.load(given.lenses)
    names = [camera.name for camera in cameras]
    waved = WavedBall.load(given.wave).of(names)
    corners = TableCorners.load(given.corners)
    pixels = corners.of(names)
    fit, held_out = waved.parts()
    placed = extrinsics.places_from_ball(cameras, fit, corners.table.corners, pixels)
    rig = Rig(placed, table=corners.table)
    rig.check()
    tell_places(placed, fit, held_out)
    tell_corners(placed, corners.table.corners, pixels)
    rig.save(given.output)
    print(f"written: {given.output}")


def tell_places(cameras: Sequence[RigCamera], fit: FloatArray, held_out: FloatArray) -> None:
    print("camera                x [m]    y [m]    z [m]")
    for camera in cameras:
        print("{:16} {:8.3f} {:8.3f} {:8.3f}".format(camera.name, *camera.place))
    found = np.isfinite(bundle.triangulated(cameras, held_out)).all(1).sum()
    away = extrinsics.reprojection(cameras, fit)
    print(f"reprojection of the moments that were fitted: {away:.3f} px")
    if found:
        away = extrinsics.reprojection(cameras, held_out)
        print(f"reprojection of those that were held out:     {away:.3f} px")
    print(f"{len(held_out) - found} of {len(held_out)} held-out moments do not fit")
    moved = 1e3 * extrinsics.left_out_distances(cameras, held_out)
    if len(moved):
        mean, most = moved.mean(), np.percentile(moved, 95)
        print(f"a held-out place, with and without one of its cameras: {mean:.1f} mm apart")
        print(f"    (mean; 95 % are below {most:.1f} mm)")


def tell_corners(cameras: Sequence[RigCamera], known: FloatArray, pixels: FloatArray) -> None:
    seen = bundle.triangulated(cameras, np.moveaxis(pixels, 0, 1))
    there = np.isfinite(seen).all(1)
    away = 1e3 * np.linalg.norm(seen - known, axis=1)[there]
    print(f"corners of the table: {away.mean():.1f} mm from where they are, at most", end=" ")
    print(f"{away.max():.1f} mm")
    alone = 1e3 * left_out_errors(seen[there], known[there])
    if len(alone):
        print(f"each corner, placed by the other three: {alone.mean():.1f} mm, at most", end=" ")
        print(f"{alone.max():.1f} mm")


# ---------------------------------------------------------------------- the command line


def two_numbers(text: str) -> tuple[int, int]:
    """Parses two numbers from a text such as 9x6."""
    first, _, second = text.partition("x")
    if not (first.isdecimal() and second.isdecimal()):
        raise argparse.ArgumentTypeError(f"two numbers such as 9x6 are needed, got '{text}'")
    return int(first), int(second)


def parser() -> argparse.ArgumentParser:
    made = argparse.ArgumentParser(
        prog="python -m o80_devices.calibration.calibrate",
        description="Calibrates a rig of cameras: lenses, then pictures and wave, then places.",
    )
    steps = made.add_subparsers(required=True, metavar="STEP")

    step = steps.add_parser("lenses", help="focal lengths and distortion, from a chessboard")
    step.add_argument(
        "folder", type=Path, nargs="?", help="with a folder of pictures for each camera"
    )
    step.add_argument("--segment", default="", help="running cameras, instead of a folder")
    step.add_argument("--names", default="", help="of the cameras of the segment, in their order")
    step.add_argument("--size", type=two_numbers, default=(640, 480), help="of their images [px]")
    step.add_argument("--pictures", type=int, default=16, help="of each camera of the segment")
    step.add_argument("--board", type=two_numbers, default=(9, 6), help="inner corners, as in 9x6")
    step.add_argument("--square", type=float, required=True, help="length of a side [m]")
    step.add_argument("-o", "--output", type=Path, default=Path("lenses.json"))
    step.set_defaults(run=calibrate_lenses)

    step = steps.add_parser("pictures", help="saves a picture of each camera, to mark corners in")
    live_options(step)
    step.add_argument("-o", "--output", type=Path, default=Path("pictures"))
    step.set_defaults(run=save_pictures)

    step = steps.add_parser("wave", help="records where the cameras see a waved ball")
    live_options(step)
    step.add_argument("--moments", type=int, default=300, help="to record")
    step.add_argument("--colours", default="", help="file of the colours of the ball; else orange")
    step.add_argument("-o", "--output", type=Path, default=Path("wave.npz"))
    step.set_defaults(run=record_wave)

    step = steps.add_parser("places", help="the rig, from lenses, waved ball and table corners")
    step.add_argument("--lenses", type=Path, default=Path("lenses.json"))
    step.add_argument("--wave", type=Path, default=Path("wave.npz"))
    step.add_argument("--corners", type=Path, required=True, help="the table in the images")
    step.add_argument("-o", "--output", type=Path, default=Path("rig.json"))
    step.set_defaults(run=calibrate_places)
    return made


def live_options(step: argparse.ArgumentParser) -> None:
    step.add_argument("--segment", default="video_cameras", help="of the cameras, or several: A,B")
    step.add_argument("--lenses", type=Path, default=Path("lenses.json"))


def main(arguments: Sequence[str] | None = None) -> None:
    given = parser().parse_args(arguments)
    try:
        given.run(given)
    except (o80.Error, OSError) as error:
        sys.exit(f"o80: {error}")
    except KeyboardInterrupt:
        sys.exit("\nended, nothing was written")


if __name__ == "__main__":
    keep_printing()
    main()
