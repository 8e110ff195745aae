"""The packages of the application use only those before them, so that each can be read alone."""

import ast
from pathlib import Path

import pytest

import o80_table_tennis

PACKAGE = Path(o80_table_tennis.__file__).parent
ORDER = ("world", "physics", "balls", "task", "settings", "rig", "report", "players")
MODULES = sorted(PACKAGE.rglob("*.py"))
LONGEST = 400  # lines


def layer(module: Path) -> int:
    """Place of a module in the order; what stands beside the packages may use all of them."""
    name = module.relative_to(PACKAGE).parts[0].removesuffix(".py")
    return ORDER.index(name) if name in ORDER else len(ORDER)


def used(module: Path) -> set[str]:
    """Imports of a module from this package: names of packages, or of modules beside them."""
    depth = len(module.relative_to(PACKAGE).parts)
    return {
        (node.module or "").split(".")[0]
        for node in ast.walk(ast.parse(module.read_text()))
        if isinstance(node, ast.ImportFrom) and node.level == depth
    }


@pytest.mark.parametrize("module", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_a_module_uses_only_packages_before_its_own(module: Path) -> None:
    upwards = {name for name in used(module) if layer(PACKAGE / name) > layer(module)}
    assert not upwards
    assert len(module.read_text().splitlines()) <= LONGEST
