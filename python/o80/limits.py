"""What a number of an actuator's state may do."""

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass

from o80.errors import InvalidArgument


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits of one number, in the unit of its field; what is not given is not limited.

    An acceleration needs a speed, a jerk needs an acceleration.
    """

    minimum: float = -math.inf
    maximum: float = math.inf
    speed: float = math.inf  #: [unit/s]
    acceleration: float = math.inf  #: [unit/s^2]
    jerk: float = math.inf  #: [unit/s^3]
    error: float = math.inf  #: desired and observed further apart than that halt the backend

    @classmethod
    def of(cls, given: "Limits | Sequence[float | None]") -> "Limits":
        """The same; or from (minimum, maximum, ...), in the order of the fields."""
        if isinstance(given, Limits):
            return given
        names = ("minimum", "maximum", "speed", "acceleration", "jerk", "error")
        if not isinstance(given, (tuple, list)) or len(given) > len(names):
            raise InvalidArgument(
                f"limits cannot be {given!r}: give o80.Limits({', '.join(n + '=' for n in names)})"
            )
        pairs = zip(names, given, strict=False)
        return cls(**{name: value for name, value in pairs if value is not None})

    def numbers(self) -> tuple[float, ...]:
        """All of them, in the order of the fields."""
        return astuple(self)
