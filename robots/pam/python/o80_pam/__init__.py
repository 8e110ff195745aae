"""A simulated arm with pneumatic artificial muscles: `o80.robots.load("pam")`."""

from pathlib import Path


def library() -> Path:
    """The robot library, which o80 loads."""
    return Path(__file__).parent / "lib" / "pam.so"
