"""Rules that every module of the package keeps."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import o80_devices

PACKAGE = Path(o80_devices.__file__).parent
MODULES = sorted(PACKAGE.rglob("*.py"))
LONGEST = 300  # lines
HEAVY = {"cv2", "google.protobuf", "motioncapture", "scipy", "zmq"}  # extras: imported when needed


def name_of(module: Path) -> str:
    parts = (PACKAGE.name, *module.relative_to(PACKAGE).with_suffix("").parts)
    return ".".join(parts).removesuffix(".__init__")


@pytest.mark.parametrize("module", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_a_module_is_short(module: Path) -> None:
    assert len(module.read_text().splitlines()) <= LONGEST


def test_a_room_uses_only_those_before_it() -> None:
    rooms = ("cameras", "ball_tracking", "calibration")
    upward = [
        f"{file.relative_to(PACKAGE)} imports {used}"
        for place, room in enumerate(rooms)
        for file in (PACKAGE / room).glob("*.py")
        for used in re.findall(r"^ *from o80_devices\.(\w+)", file.read_text(), re.MULTILINE)
        if used in rooms[place + 1 :]
    ]
    assert not upward
    assert max(len(list(folder.glob("*.py"))) for folder in PACKAGE.iterdir()) <= 25


def test_modules_are_imported_without_extras() -> None:
    names = [name_of(each) for each in MODULES if each.name != "__main__.py"]
    program = f"""
import importlib, sys
for name in {names}:
    importlib.import_module(name)
print(*sorted({HEAVY} & set(sys.modules)))
"""
    found = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert not found.stdout.split()
