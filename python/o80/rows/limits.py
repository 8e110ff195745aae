"""Limits of the numbers of an actuator's state."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from o80.base import argument_checks
from o80.base.errors import InvalidArgument


@dataclass(frozen=True)
class IntegralBounds:
    """Bounds of what a number moves: a velocity moves the observed position of its actuator.

    o80 brakes the velocity in time, and lets it move inward only where the position is outside. The
    velocity rests at 0 and has no limit of jerk.
    """

    field: str  #: of the observed state; of an array, the element of the same index
    minimum: float = -math.inf
    maximum: float = math.inf
    reaction: float = 0.0  #: time from the desired velocity to the observed one [s]

    def __post_init__(self) -> None:
        argument_checks.text(self.field, "field of o80.IntegralBounds")
        for name in ("minimum", "maximum", "reaction"):
            number = argument_checks.number(getattr(self, name), f"{name} of o80.IntegralBounds")
            object.__setattr__(self, name, number)

    def numbers(self) -> list[float]:
        """Minimum, maximum and reaction."""
        return [self.minimum, self.maximum, self.reaction]


NUMBERS = ("minimum", "maximum", "speed", "acceleration", "jerk", "error", "noise")


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
    noise: float = 0.0  #: largest difference of two readings at rest; 0: a tenth of `error`
    integral: IntegralBounds | None = None  #: what the number moves, if it is a velocity

    def __post_init__(self) -> None:
        for name in NUMBERS:
            number = argument_checks.number(getattr(self, name), f"{name} of o80.Limits")
            object.__setattr__(self, name, number)
        if not isinstance(self.integral, IntegralBounds | None):
            raise InvalidArgument(
                f"integral of o80.Limits must be o80.IntegralBounds(...), got {self.integral!r}"
            )

    @classmethod
    def of(cls, given: "Limits | Sequence[float | None]") -> "Limits":
        """Limits from Limits, or from (minimum, maximum, ...) in the order of the fields."""
        if isinstance(given, Limits):
            return given
        if not isinstance(given, (tuple, list)) or len(given) > len(NUMBERS):
            raise InvalidArgument(
                f"limits must be o80.Limits({', '.join(n + '=' for n in NUMBERS)}), got {given!r}"
            )
        pairs = zip(NUMBERS, given, strict=False)
        return cls(**{name: value for name, value in pairs if value is not None})

    def numbers(self) -> tuple[float, ...]:
        """All limits but those of the integral, in the order of the fields."""
        return tuple(getattr(self, name) for name in NUMBERS)
