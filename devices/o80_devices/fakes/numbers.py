"""Command lines of fakes, and the numbers on them; errors name the option."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from typing import Any


def parser(fake: str, **options: tuple[Callable[[str], Any], Any, str]) -> argparse.ArgumentParser:
    """Parser of the module `fake`. options: type, default and help by name."""
    made = argparse.ArgumentParser(prog=f"python -m o80_devices.fakes.{fake}")
    for name, (kind, default, text) in options.items():
        made.add_argument(f"--{name.replace('_', '-')}", type=kind, default=default, help=text)
    return made


def positive(text: str) -> float:
    return _checked(text, "a positive number", lambda value: value > 0)


def not_negative(text: str) -> float:
    return _checked(text, "a number of at least 0", lambda value: value >= 0)


def share(text: str) -> float:
    return _checked(text, "a share between 0 and 1", lambda value: 0 <= value <= 1)


def count(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"a whole number of at least 0 is needed, got '{text}'")
    return int(text)


def port(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 65535:
        raise argparse.ArgumentTypeError(f"a port from 1 to 65535 is needed, got '{text}'")
    return int(text)


def vector(text: str) -> tuple[float, float, float]:
    """Parses a vector from a text such as 0.4,2.9,0"""
    try:
        x, y, z = (float(each) for each in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"three numbers such as 0.4,2.9,0 are needed, got '{text}'"
        ) from None
    return x, y, z


def _checked(text: str, needed: str, is_right: Callable[[float], bool]) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and is_right(value)):
        raise argparse.ArgumentTypeError(f"{needed} is needed, got '{text}'")
    return value
