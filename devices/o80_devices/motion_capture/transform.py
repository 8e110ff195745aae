"""Transform from the frame of a motion capture system to the world frame."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from o80.base.arrays import FloatArray
from o80.base.finite import json_text
from o80.errors import InvalidArgument


@dataclass(frozen=True)
class Transform:
    """p_world = rotation p + translation."""

    rotation: FloatArray  #: (3, 3)
    translation: FloatArray  #: (3,) [m]
    residuals: Mapping[str, float]  #: residual of the points of the estimate [m]

    @classmethod
    def estimated(
        cls, measured: Mapping[str, Sequence[float]], known: Mapping[str, Sequence[float]]
    ) -> Transform:
        """Fits the rigid transform from measured points to known ones.

        Raises InvalidArgument for fewer than three common points, or points on a line.
        """
        names = sorted(set(measured) & set(known))
        if len(names) < 3:
            raise InvalidArgument(
                f"at least three points must be both measured and known, got {names} "
                f"(measured: {sorted(measured)}, known: {sorted(known)})"
            )
        source = np.array([measured[name] for name in names], float)
        target = np.array([known[name] for name in names], float)
        if not (np.isfinite(source).all() and np.isfinite(target).all()):
            raise InvalidArgument("points must be finite: leave out points that were not visible")
        found = rotation_between(source, target)
        if found is None:
            raise InvalidArgument(f"the points {names} lie on a line: add one beside it")
        rotation = found[0]
        translation = target.mean(axis=0) - rotation @ source.mean(axis=0)
        left_over = np.linalg.norm(source @ rotation.T + translation - target, axis=1)
        return cls(rotation, translation, dict(zip(names, left_over.tolist(), strict=True)))

    @classmethod
    def load(cls, file: Path) -> Transform:
        """Reads a transform. Raises InvalidArgument if the file holds none."""
        try:
            content = json.loads(file.read_text())
            rotation = np.array(content["rotation"], float)
            translation = np.array(content["translation"], float)
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InvalidArgument(
                f"{file} is not a transform file ({type(error).__name__}: {error}): expected "
                '{"rotation": [[...], [...], [...]], "translation": [x, y, z]}'
            ) from error
        if rotation.shape != (3, 3) or translation.shape != (3,):
            raise InvalidArgument(
                f"{file}: rotation must be 3 x 3 and translation have 3 numbers, got "
                f"{rotation.shape} and {translation.shape}"
            )
        off = np.abs(rotation @ rotation.T - np.eye(3)).max()
        if not off < 1e-6 or np.linalg.det(rotation) < 0 or not np.isfinite(translation).all():
            raise InvalidArgument(
                f"{file}: rotation must be a rotation matrix, and all numbers finite"
            )
        return cls(rotation, translation, content.get("residuals", {}))

    def save(self, file: Path) -> None:
        content: dict[str, Any] = {
            "rotation": self.rotation.tolist(),
            "translation": self.translation.tolist(),
            "residuals": dict(self.residuals),
        }
        file.write_text(json_text(content, indent=2) + "\n")

    def of_point(self, point: Sequence[float]) -> FloatArray:
        moved: FloatArray = self.rotation @ np.asarray(point, float) + self.translation
        return moved

    def of_pose(
        self, position: Sequence[float], quaternion: Sequence[float]
    ) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Transforms a position [m] and a quaternion (x, y, z, w) to the world."""
        turned = product(quaternion_of(self.rotation), quaternion)
        return tuple(self.of_point(position).tolist()), turned


def rotation_between(source: FloatArray, target: FloatArray) -> tuple[FloatArray, float] | None:
    """Rotation (3, 3), and scale, that fit points (n, 3) to others best, each about its mean.

    None for points on a line. (Umeyama, 1991)
    """
    apart, wanted = source - source.mean(axis=0), target - target.mean(axis=0)
    left, sizes, right = np.linalg.svd(wanted.T @ apart)
    if not sizes[1] > 1e-6 * sizes[0]:
        return None
    # points in a plane fit a reflection equally well
    mirror = np.array([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    return left @ np.diag(mirror) @ right, float((sizes * mirror).sum() / (apart**2).sum())


def quaternion_of(rotation: FloatArray) -> tuple[float, ...]:
    """Converts a rotation matrix to x, y, z, w with w >= 0; computes the largest one first."""
    (a, b, c), (d, e, f), (g, h, i) = rotation.tolist()
    squares = [1 + a - e - i, 1 - a + e - i, 1 - a - e + i, 1 + a + e + i]  # 4 x^2, 4 y^2, ...
    columns = [
        (squares[0], b + d, c + g, h - f),
        (b + d, squares[1], f + h, c - g),
        (c + g, f + h, squares[2], d - b),
        (h - f, c - g, d - b, squares[3]),
    ]
    chosen = columns[squares.index(max(squares))]
    norm = math.copysign(math.sqrt(sum(each**2 for each in chosen)), chosen[3])
    return tuple(each / norm for each in chosen)


def product(one: Sequence[float], two: Sequence[float]) -> tuple[float, ...]:
    """Composes two rotations: `two`, then `one`."""
    x, y, z, w = one
    a, b, c, d = two
    return (
        w * a + x * d + y * c - z * b,
        w * b - x * c + y * d + z * a,
        w * c + x * b - y * a + z * d,
        w * d - x * a - y * b - z * c,
    )
