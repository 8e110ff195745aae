"""The folder in which o80 is installed."""

from pathlib import Path


def prefix() -> Path:
    """The folder that holds o80's include/, lib/ and bin/."""
    return Path(__file__).resolve().parents[1]
