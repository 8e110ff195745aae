"""What installed packages announce to o80 by entry points."""

import os
import sys
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint


@cache
def announced(group: str) -> "dict[str, EntryPoint]":
    """The entry points of a group, by name.

    The standard library takes milliseconds to read those of all packages, and as long to be
    imported, so it is asked only if a package names the group.
    """
    if not any(_names_group(folder or os.curdir, group.encode()) for folder in sys.path):
        return {}
    from importlib.metadata import entry_points

    return {point.name: point for point in entry_points(group=group)}


def _names_group(place: str, group: bytes) -> bool:
    """Whether a package in a folder of sys.path may have such an entry point."""
    try:
        names = os.listdir(place)
    except NotADirectoryError:
        return True  # an archive: only the standard library looks into it
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
