"""Any MuJoCo model as a robot: `o80.robots.load("mujoco")`."""

from pathlib import Path

from o80.base.installation import check_version

check_version("o80-mujoco")


def library() -> Path:
    """Path of the robot library, which o80 loads."""
    # an editable installation has two folders: one of sources, one of built files
    files = [Path(folder) / "lib" / "mujoco.so" for folder in __path__]
    return next((file for file in files if file.exists()), files[0])
