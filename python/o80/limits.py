"""Limits of the numbers of an actuator's state."""

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass

from o80.errors import InvalidArgument


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits of one number, in the unit of its field; the default is no limit.

    A limit of acceleration needs one of speed; a limit of jerk needs one of acceleration.
    """

    minimum: float = -math.inf
    maximum: float = math.inf
    speed: float = math.inf  #: [unit/s]
    acceleration: float = math.inf  #: [unit/s^2]
    jerk: float = math.inf  #: [unit/s^3]
    error: float = math.inf  #: a larger difference of desired and observed halts the backend

    @classmethod
    def of(cls, given: "Limits | Sequence[float | None]") -> "Limits":
        """Limits from Limits, or from (minimum, maximum, ...) in the order of the fields."""
        if isinstance(given, Limits):
            return given
        names = ("minimum", "maximum", "speed", "acceleration", "jerk", "error")
        if not isinstance(given, (tuple, list)) or len(given) > len(names):
            raise InvalidArgument(
                f"limits must be o80.Limits({', '.join(n + '=' for n in names)}), got {given!r}"
            )
        pairs = zip(names, given, strict=False)
        return cls(**{name: value for name, value in pairs if value is not None})

    def numbers(self) -> tuple[float, ...]:
        """All limits, in the order of the fields."""
        return astuple(self)
