"""Checks of arguments. Each error names the argument, what it must be, and what it is."""

import operator
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from o80.base.errors import InvalidArgument


def whole(value: Any, name: str, least: int | None = None) -> int:
    """Returns a whole number of at least `least`. Raises InvalidArgument for another value."""
    try:
        if isinstance(value, bool):
            raise TypeError
        number = operator.index(value)
    except TypeError:
        raise InvalidArgument(f"{name} must be a whole number, got {value!r}") from None
    if least is not None and number < least:
        raise InvalidArgument(f"{name} must be at least {least}, got {number}")
    return number


def whole_or_none(value: Any, name: str, least: int | None = None) -> int | None:
    """Returns a whole number or None. Raises InvalidArgument for another value."""
    return None if value is None else whole(value, name, least)


def iterations(value: Any, name: str, period: float, least: int) -> int:
    """Converts a time to iterations: a whole number of them, or a float of seconds.

    period: of an iteration [s]. Raises InvalidArgument for another value.
    """
    if not isinstance(value, (float, np.floating)):
        return whole(value, name, least)
    if not 0 <= value < 2**62 * period:
        raise InvalidArgument(f"{name} must be seconds from 0, or iterations, got {value!r}")
    return max(round(float(value) / period), least)


def number(value: Any, name: str) -> float:
    """Converts a number of Python or NumPy to float. Raises InvalidArgument for another value."""
    try:
        if not isinstance(value, (bool, np.bool_, str, bytes)):
            return float(value)
    except (TypeError, ValueError, OverflowError):
        pass
    raise InvalidArgument(f"{name} must be a number, got {value!r}")


def text(value: Any, name: str) -> str:
    """Returns a text unchanged. Raises InvalidArgument with the argument's name for others."""
    if not isinstance(value, str):
        raise InvalidArgument(f"{name} must be a string, got {value!r}")
    return value


def nothing(value: Any, call: str, otherwise: str = "") -> None:
    """Raises InvalidArgument if a function of the user returned a value."""
    if value is not None:
        raise InvalidArgument(f"{call} must return None{otherwise}; got {value!r}")


def mapping(value: Any, name: str, holds: str) -> Mapping[Any, Any]:
    """Returns a mapping; an empty one for None. Raises InvalidArgument for another value."""
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise InvalidArgument(f"{name} must be a mapping from {holds}, got {value!r}")
    return value


def sequence(value: Any, name: str, example: str) -> Sequence[Any]:
    """Converts a sequence to a list. Raises InvalidArgument for a string or another value."""
    if isinstance(value, str | bytes) or not isinstance(value, (Sequence, np.ndarray)):
        raise InvalidArgument(f"{name} must be a list such as {example}, got {value!r}")
    return list(value)
