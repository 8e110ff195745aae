"""Folder of o80, and entry points by which installed packages register robots and frontends."""

import os
import sys
from functools import cache
from typing import TYPE_CHECKING

from o80._core import version

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint
    from pathlib import Path


@cache
def announced(group: str) -> "dict[str, EntryPoint]":
    """Returns the entry points of a group, by name.

    importlib.metadata takes milliseconds to import and to read all packages, so it is used only if
    a package has an entry point of this group.
    """
    if not any(_names_group(folder or os.curdir, group.encode()) for folder in sys.path):
        return {}
    from importlib.metadata import entry_points

    return {point.name: point for point in entry_points(group=group)}


def _names_group(place: str, group: bytes) -> bool:
    """True if a package in a folder of sys.path may have an entry point of the group."""
    try:
        names = os.listdir(place)
    except NotADirectoryError:
        return True  # an archive: importlib.metadata reads it
    except OSError:
        return False
    for name in names:
        if name.endswith((".dist-info", ".egg-info")):
            try:
                with open(os.path.join(place, name, "entry_points.txt"), "rb") as file:
                    if group in file.read():
                        return True
            except OSError:
                continue
    return False


def check_version(package: str) -> None:
    """Raises ImportError if the package is installed in another version than o80.

    Sources in sys.path and frozen programs have no metadata: nothing is compared there.
    """
    from importlib import metadata

    try:
        found = metadata.version(package)
    except metadata.PackageNotFoundError:
        return
    if found != version():
        raise ImportError(
            f"{package} {found} does not fit o80 {version()}: install both in one version, "
            f"pip install {package}=={version()}"
        )


def prefix() -> "Path":
    """Returns the folder that holds o80's include/, lib/ and bin/."""
    from pathlib import Path

    return Path(__file__).resolve().parents[1]
