"""When a recording goes on in its next file: by size or by time."""

import math
import time
from dataclasses import dataclass

from o80.base.errors import InvalidArgument

_BYTES = {"k": 1e3, "M": 1e6, "G": 1e9}
_SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0}


@dataclass(frozen=True)
class Split:
    """The most that one file of a recording holds."""

    bytes: float = math.inf
    seconds: float = math.inf

    @classmethod
    def of(cls, text: str) -> "Split":
        """Split by "500M" or "2G" (bytes), "600s", "10min" or "1h". Raises InvalidArgument."""
        number = text.rstrip("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ ")
        unit = text[len(number) :].strip()
        try:
            value = float(number)
        except ValueError:
            value = 0.0
        if value > 0 and math.isfinite(value):
            if unit in _BYTES:
                return cls(bytes=value * _BYTES[unit])
            if unit in _SECONDS:
                return cls(seconds=value * _SECONDS[unit])
        raise InvalidArgument(
            f"split must be a size such as 500M or 2G, or a time such as 600s, 10min or 1h, "
            f"got '{text}'"
        )

    def is_due(self, size: int, begun: float) -> bool:
        """Whether a file of this size [bytes], begun at this monotonic time, is full."""
        return size >= self.bytes or time.monotonic() - begun >= self.seconds
