"""Import of optional packages."""

import importlib
from types import ModuleType

from o80.base.errors import MissingExtra


def needed(module: str, extra: str | None, purpose: str, *, package: str = "o80") -> ModuleType:
    """Imports a module of `package`, or a module that an extra of `package` installs.

    Raises MissingExtra with the names of module, package and extra.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        missing = module.partition(".")[0]
        what = package if extra is None else f"{package}[{extra}]"
        raise MissingExtra(
            f'{purpose} needs {missing}, which is not installed: pip install "{what}"', name=missing
        ) from error
