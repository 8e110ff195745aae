"""Build backend: scikit-build-core, and o80 as a build requirement.

In a checkout, this is the repository's o80, elsewhere the release of the same version. Without
isolation (`pip install --no-build-isolation`), the installed o80 is used in any version.
"""

import tomllib
from pathlib import Path
from typing import Any

from scikit_build_core import build
from scikit_build_core.build import *  # noqa: F403

PACKAGE = Path(__file__).resolve().parents[1]
REPOSITORY = PACKAGE.parents[1]


def o80() -> str:
    """Returns the requirement on o80."""
    if (REPOSITORY / "include" / "o80" / "o80.hpp").exists():
        return f"o80 @ {REPOSITORY.as_uri()}"
    project = tomllib.loads((PACKAGE / "pyproject.toml").read_text())["project"]
    return next(name for name in project["dependencies"] if name.startswith("o80=="))


def get_requires_for_build_wheel(settings: dict[str, Any] | None = None) -> list[str]:
    return [*build.get_requires_for_build_wheel(settings), o80()]


def get_requires_for_build_editable(settings: dict[str, Any] | None = None) -> list[str]:
    return [*build.get_requires_for_build_editable(settings), o80()]
