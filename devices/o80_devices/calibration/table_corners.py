"""Corners of the table in the images, marked by hand in one picture of each camera."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from o80.base.arrays import FloatArray
from o80.errors import InvalidArgument
from o80_devices.cameras.flight import Table
from o80_devices.cameras.rig import vector

EXAMPLE = '{"corners": {"camera_0": [[102.5, 300], [420, 310.5], [400, 120], null], ...}}'


@dataclass(frozen=True)
class TableCorners:
    """The table, and its corners in the images."""

    table: Table
    pixels: dict[str, FloatArray]
    """Corners by camera name: (4, 2) [px], in the order of `Table.corners`; NaN: not seen."""

    @classmethod
    def load(cls, path: Path | str) -> TableCorners:
        """Reads a file. Raises InvalidArgument if it holds no corners."""
        try:
            content = json.loads(Path(path).read_text())
            table = _table(**content.get("table", {}))
            pixels = {str(k): _pixels(str(k), v) for k, v in content["corners"].items()}
            sound = np.isfinite(table.corners).all() and min(table.half) > 0
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise InvalidArgument(
                f"{path} does not hold the corners of the table ({error}): expected {EXAMPLE}"
            ) from error
        if not sound:
            raise InvalidArgument(f'{path}: "middle" and "half" must be lengths [m]')
        return cls(table, pixels)

    def of(self, names: Sequence[str]) -> FloatArray:
        """(cameras, 4, 2) [px], NaN without marks. Raises InvalidArgument for other names."""
        unknown = [name for name in self.pixels if name not in names]
        if unknown:
            raise InvalidArgument(
                f"corners are marked for {unknown[0]}, but the cameras are {', '.join(names)}"
            )
        nothing = np.full((4, 2), np.nan)
        return np.array([self.pixels.get(name, nothing) for name in names])


def _table(middle: Sequence[float] = Table.middle, half: Sequence[float] = Table.half) -> Table:
    across, along = (float(value) for value in half)
    return Table(middle=vector(middle), half=(across, along))


def _pixels(name: str, marks: Any) -> FloatArray:
    if not isinstance(marks, list) or len(marks) != 4:
        raise ValueError(f"{name} must have four corners, null for one that it does not see")
    pixels = np.array([[np.nan, np.nan] if mark is None else mark for mark in marks], float)
    if pixels.shape != (4, 2):
        raise ValueError(f"a corner of {name} must be a pair of numbers")
    return pixels
