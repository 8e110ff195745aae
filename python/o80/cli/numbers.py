"""Checks of numbers that are given as options."""

import math

import typer


def positive(value: float | None) -> float | None:
    """Refuses numbers that are not positive or not finite."""
    if value is not None and not (value > 0 and math.isfinite(value)):
        raise typer.BadParameter(f"must be a positive number, got {value:g}")
    return value


def not_negative(value: float | None) -> float | None:
    """Refuses negative numbers and NaN."""
    if value is not None and not value >= 0:
        raise typer.BadParameter(f"must not be negative, got {value:g}")
    return value
