"""Arrays in JSON: float32 as base64, which also holds NaN."""

import base64
from typing import Any

import numpy as np


def packed(numbers: Any) -> str:
    """Encodes numbers as text, which the page unpacks to a Float32Array."""
    with np.errstate(over="ignore"):
        array = np.ascontiguousarray(numbers, np.float32)
    return base64.b64encode(array.tobytes()).decode()


def packed_indices(numbers: Any) -> str:
    """Encodes indices as text, which the page unpacks to a Uint32Array."""
    return base64.b64encode(np.ascontiguousarray(numbers, np.uint32).tobytes()).decode()
