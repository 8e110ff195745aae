"""The rig in a JSON file: cameras with lenses and places, the ball, and the table.

World frame: z up, lengths in metres. The frame of a camera follows OpenCV: x to the
right of the image, y down, z ahead. `point_in_camera = rotation @ point + translation`.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from o80.base.arrays import FloatArray
from o80.base.finite import json_text
from o80.errors import InvalidArgument
from o80_devices import _vision
from o80_devices.cameras.flight import Flight, FlightLaw, Table, Vector

FORMAT = "o80-ball-rig-1"


@dataclass(frozen=True)
class RigCamera:
    """One calibrated camera."""

    name: str
    size: tuple[int, int]
    """Width and height [px]."""
    focal: tuple[float, float]
    """[px]"""
    centre: tuple[float, float]
    """[px]; the centre of the first pixel is (0, 0)."""
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)
    """k1, k2, p1, p2, k3, as OpenCV writes them."""
    rotation: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    """World to camera, row by row."""
    translation: Vector = (0.0, 0.0, 0.0)
    """World to camera [m]."""

    def model(self) -> _vision.Camera:
        """Builds the compiled camera. Raises InvalidArgument if the numbers are no camera."""
        try:
            return _vision.Camera(
                self.size, self.focal, self.centre, self.distortion, self.rotation, self.translation
            )
        except (TypeError, ValueError) as error:
            raise InvalidArgument(f"camera '{self.name}' of the rig: {error}") from None

    @property
    def place(self) -> FloatArray:
        """Place (3,) of the camera in the world [m]."""
        rotation = np.reshape(self.rotation, (3, 3))
        place: FloatArray = -rotation.T @ self.translation
        return place

    def moved(self, rotation: FloatArray, translation: FloatArray) -> RigCamera:
        """Returns the camera with another pose."""
        return replace(
            self,
            rotation=tuple(float(x) for x in np.ravel(rotation)),
            translation=vector(translation),
        )


@dataclass(frozen=True)
class Rig:
    """Cameras, ball and table."""

    cameras: tuple[RigCamera, ...]
    flight: Flight = field(default_factory=Flight)
    table: Table | None = field(default_factory=Table)

    def models(self) -> list[_vision.Camera]:
        return [camera.model() for camera in self.cameras]

    def law(self) -> FlightLaw:
        """The law of flight and bounce. Raises MissingExtra without o80-mujoco."""
        return FlightLaw(self.flight, self.table)

    def save(self, path: Path | str) -> None:
        text = json_text({"format": FORMAT, **asdict(self)}, indent=1)
        Path(path).write_text(text + "\n")

    @staticmethod
    def load(path: Path | str) -> Rig:
        """Reads a rig. Raises InvalidArgument, which names the file and the fault."""
        try:
            read = json.loads(Path(path).read_text())
            if not isinstance(read, dict) or read.pop("format", None) != FORMAT:
                raise InvalidArgument(f'"format" must be "{FORMAT}"')
            cameras = tuple(RigCamera(**with_tuples(each)) for each in read["cameras"])
            table = read.get("table")
            rig = Rig(
                cameras,
                Flight(**with_tuples(read.get("flight", {}))),
                None if table is None else Table(**with_tuples(table)),
            )
            rig.check()
        except (OSError, KeyError, TypeError, ValueError) as error:
            raise InvalidArgument(f"the rig {path} cannot be used: {error}") from error
        return rig

    def check(self) -> None:
        """Raises InvalidArgument for a wrong number of cameras, equal names or invalid values."""
        if not 2 <= len(self.cameras) <= 16:
            raise InvalidArgument(f"a rig has 2 to 16 cameras, got {len(self.cameras)}")
        names = [camera.name for camera in self.cameras]
        if len(set(names)) < len(names):
            raise InvalidArgument(f"two cameras have the same name: {', '.join(names)}")
        self.models()
        try:
            self.law()
        except TypeError:
            raise InvalidArgument("a value of the flight or table is not a number") from None


def with_tuples(fields: dict[str, Any]) -> dict[str, Any]:
    """Fields of JSON with flat tuples in place of lists."""
    return {k: tuple(np.ravel(v).tolist()) if isinstance(v, list) else v for k, v in fields.items()}


def vector(values: FloatArray | Sequence[float]) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z


def looking(place: Sequence[float], at: Sequence[float]) -> tuple[FloatArray, FloatArray]:
    """Rotation (3, 3) and translation (3,) of an upright camera that faces the point `at`."""
    ahead = np.subtract(at, place) / np.linalg.norm(np.subtract(at, place))
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    rotation = np.array([right, np.cross(ahead, right), ahead])
    return rotation, -rotation @ np.asarray(place, float)


def four_cameras() -> Rig:
    """A rig for tests and demonstrations: a camera beside each corner of the table, 2.4 m high.

    640 x 480 pixels, focal length 520 px (63 degrees wide), baselines 3.0 m across the table and
    3.8 m along it; the middle of the table is 2.9 m from each camera.
    """
    places = [(-1.1, -0.33, 2.4), (1.9, -0.33, 2.4), (1.9, 3.47, 2.4), (-1.1, 3.47, 2.4)]
    cameras = []
    for i, place in enumerate(places):
        lens = RigCamera(
            name=f"camera_{i}",
            size=(640, 480),
            focal=(520.0 + 2 * i, 520.0 + 2 * i),
            centre=(320.0 + i, 238.0 - i),
            distortion=(-0.11, 0.06, 0.0004, -0.0003, -0.01),
        )
        cameras.append(lens.moved(*looking(place, (0.4, 1.57, 1.0))))
    return Rig(tuple(cameras))
