"""Import of optional packages."""

import importlib
from types import ModuleType

from o80.errors import MissingExtra


def needed(module: str, extra: str, purpose: str) -> ModuleType:
    """Imports a module that an extra of o80 installs. Raises MissingExtra with its name."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        raise MissingExtra(
            f'{purpose} needs {package}, which is not installed: pip install "o80[{extra}]"',
            name=package,
        ) from error
