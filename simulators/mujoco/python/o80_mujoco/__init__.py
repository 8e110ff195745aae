"""Any MuJoCo model as a robot: `o80.robots.load("mujoco")`."""

from pathlib import Path


def library() -> Path:
    """The robot library, which o80 loads."""
    return Path(__file__).parent / "lib" / "mujoco.so"
