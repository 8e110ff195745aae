"""Arms of bus servos: `o80.robots.load("so101")`."""

from pathlib import Path


def so101() -> Path:
    """The robot library, which o80 loads."""
    # an editable installation has two folders: the sources, and what was built
    files = [Path(folder) / "lib" / "so101.so" for folder in __path__]
    return next((file for file in files if file.exists()), files[0])
