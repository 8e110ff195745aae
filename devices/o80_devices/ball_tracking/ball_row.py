"""Row of a tracked ball."""

from __future__ import annotations

from enum import IntEnum
from typing import Any

import numpy as np


class Reason(IntEnum):
    """Reason why a row has no ball."""

    seen = 0
    """The row has a ball."""
    no_image = 1
    """No new images: the cameras are stopped, late, or disconnected."""
    not_found = 2
    """Fewer than two cameras detect a ball."""
    no_agreement = 3
    """The detections of the cameras do not agree on a place."""
    unexpected = 4
    """The sighting does not continue the flight; a second one means a hit or another ball."""


EXTENDED: dict[str, Any] = {
    "capture_time": np.int64,
    "reason": Reason,
    "ball": np.int64,
    "position": (np.float64, (3,)),
    "velocity": (np.float64, (3,)),
    "spin": (np.float64, (3,)),
    "covariance": (np.float64, (9, 9)),
    "error": np.float64,
    "measured": (np.float64, (3,)),
    "cameras": np.uint64,
    "residual": np.float64,
    "image_time": np.int64,
    "stamp": np.int64,
    "capture_error": np.int64,
}
UNITS = {
    "capture_time": "ns",
    "position": "m",
    "velocity": "m/s",
    "spin": "rad/s",
    "error": "m",
    "measured": "m",
    "residual": "px",
    "image_time": "ns",
    "stamp": "ns",
    "capture_error": "ns",
}
