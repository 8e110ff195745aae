"""Decides which robots and files a replay loads: a recording may come from a stranger.

A recording can name any library and any file of this computer. A replay loads only robots that are
found here by their names, and reads only files whose content is the recorded one, unless the user
names them or the run is one of the user's own robots in shared memory.
"""

import hashlib
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import o80.robots.robot as robots
from o80.base.errors import DriverError, InvalidArgument

if TYPE_CHECKING:
    from o80.replaying.recorded_run import RecordedRun
    from o80.rows.provenance import Provenance

_LARGEST_HASHED = 64 << 20  # largest file that is hashed [bytes], as at recording


def robot_of(run: "RecordedRun") -> Path | str | type[Any]:
    """Returns the recorded robot: its library, or its class in Python.

    Raises DriverError if no robot of this name is known here.
    """
    recorded = run.provenance.library
    if run.is_own and robots.is_place(recorded) and Path(recorded.rpartition(":")[0]).exists():
        from o80.drivers.driver_class import loaded

        return loaded(recorded) or recorded
    if run.is_own and recorded and Path(recorded).exists():
        return Path(recorded)
    name = run.schema["robot"]
    for known in robots.list():
        if known.name == name:
            return known.path
    ran = f", and ran from {recorded!r}" if recorded else ""
    raise DriverError(
        f"segment '{run.segment}' is of robot {name!r}{ran}. No robot of this name is found here. "
        f"A recording may name any library, so it is not loaded: if you trust a library, give "
        f"--robot FILE.so or FILE.py:Class, in Python robot=. Or compare only desired states, with "
        f"--without-driver"
    )


def options_of(
    run: "RecordedRun", library: robots.Robot, given: Mapping[str, str]
) -> dict[str, str]:
    """Returns the recorded options of the robot, overridden by those that the user gives.

    Raises InvalidArgument for a recorded file that has another content here.
    """
    recorded = dict(run.provenance.options)
    if not run.is_own:
        for option in library.options:
            text = recorded.get(option.name, "")
            is_free = option.name in given or text in ("", option.default)
            if option.kind == "text" and not is_free:
                recorded[option.name] = _checked(option.name, text, run.provenance)
    return recorded | dict(given)


def _checked(option: str, text: str, provenance: "Provenance") -> str:
    """Returns the option's text, or the path of a file with the recorded content; else raises."""
    files = [file for file in provenance.files if file.option == option]
    path = Path(text)
    if not files and not _may_be_a_file(path):
        return text
    for file in files:
        for place in (path, Path(file.path)):
            if file.sha256 and _sha256(place) == file.sha256:
                return str(place)
    there = "has another content here" if path.exists() else "is not here"
    raise InvalidArgument(
        f"the recorded option {option} names the file {text!r}, which {there}. A recording may "
        f"name any file, so it is not read: to use one, give --set {option}=FILE, in Python "
        f"options={{{option!r}: FILE}}"
    )


def _may_be_a_file(path: Path) -> bool:
    leads_away = path.is_absolute() or ".." in path.parts or path.parts[:1] == ("~",)
    try:
        return leads_away or (path.exists() and not path.is_dir())
    except (OSError, ValueError):
        return True


def _sha256(path: Path) -> str:
    """SHA-256 of a regular file's content; empty if it cannot be read."""
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode) or status.st_size > _LARGEST_HASHED:
            return ""
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except (OSError, ValueError):
        return ""
