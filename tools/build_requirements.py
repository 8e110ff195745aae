"""Prints the external requirements of this repository's packages, one a line.

`build`: requirements of a build. `run`: requirements at run time. Further words name extras, which
are read from all packages that define them.
"""

import sys
import tomllib
from typing import Any

from sources import ROOT

PACKAGES = (
    ".",
    "simulators/mujoco",
    "robots/pam",
    "robots/arms",
    "devices",
    "apps/table_tennis",
    "gateways/lerobot",
    "gateways/ros2",
)
ELSEWHERE = ("o80=", "o80-", "o80[", "lerobot>")
"""Prefixes of omitted requirements: the packages themselves, and LeRobot (tools/lerobot.txt)."""


def pyproject(package: str) -> dict[str, Any]:
    return tomllib.loads((ROOT / package / "pyproject.toml").read_text())


def requirements(kind: str, extras: list[str]) -> list[str]:
    """Collects the requirements of all packages, without ELSEWHERE."""
    found: set[str] = set()
    for package in PACKAGES:
        project = pyproject(package)["project"]
        if kind == "build":
            found.update(pyproject(package)["build-system"]["requires"])
        else:
            found.update(project["dependencies"])
            for extra in extras:
                found.update(project.get("optional-dependencies", {}).get(extra, []))
    return sorted(each for each in found if not each.startswith(ELSEWHERE))


if __name__ == "__main__":
    print(*requirements(sys.argv[1], sys.argv[2:]), sep="\n")
