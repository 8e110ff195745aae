"""Import of optional packages."""

import importlib
from types import ModuleType

from o80.errors import MissingExtra


def needed(module: str, extra: str, purpose: str, *, package: str = "o80") -> ModuleType:
    """Imports a module that an extra of `package` installs. Raises MissingExtra with both names."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        missing = module.partition(".")[0]
        raise MissingExtra(
            f'{purpose} needs {missing}, which is not installed: pip install "{package}[{extra}]"',
            name=missing,
        ) from error
