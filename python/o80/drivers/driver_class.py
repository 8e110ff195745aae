"""Makes a driver class in Python a robot: finds it by "module:Class", describes it for C++."""

import importlib
import importlib.util
import inspect
import platform
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import o80._core as _core
from o80.base.errors import DriverError, Error, InvalidArgument
from o80.drivers.adapter import Adapter, check_verbs
from o80.drivers.option import Options

#: place of the driver that this process is importing, if it is the process of a robot
imported_to_run = ""


def found_to_run(place: str) -> type[Any]:
    """Calls `found` in the process of that robot, where the import may start no other robot."""
    global imported_to_run
    imported_to_run = place
    try:
        return found(place)
    finally:
        imported_to_run = ""


def found(place: str) -> type[Any]:
    """Imports the class at "module:Class" or "file.py:Class". Raises DriverError if it fails."""
    driver: type[Any] = imported(place, "driver", DriverError, type)
    return driver


def imported(place: str, what: str, failure: type[Error], *kinds: type[Any]) -> Any:
    """Imports the object at "module:name" or "file.py:name". Raises `failure` for other kinds.

    what: noun for the error message.
    """
    where, _, name = place.rpartition(":")
    try:
        module = _file(Path(where)) if where.endswith(".py") else importlib.import_module(where)
    except Exception as error:
        raise failure(
            f"the {what} {place!r} cannot be imported: {type(error).__name__}: {error}"
        ) from error
    value = getattr(module, name, None)
    if not isinstance(value, kinds):
        names = [key for key, each in vars(module).items() if isinstance(each, kinds)]
        kind = "class" if kinds == (type,) else "class or function"
        raise failure(f"{where} has no {kind} '{name}'{_core.names_instead(name, sorted(names))}")
    return value


def _file(path: Path) -> Any:
    """Imports a file as the module of its name; adds its folder to the import path."""
    path = path.resolve()
    if path.stem not in sys.modules and str(path.parent) not in sys.path:
        sys.path.insert(0, str(path.parent))
    module = importlib.import_module(path.stem)
    file = getattr(module, "__file__", None)
    if file is None or Path(file).resolve() != path:
        raise ImportError(
            f"this program has another module '{path.stem}', of {file or 'Python itself'}: rename "
            f"the file"
        )
    return module


def place_of(driver: Any) -> str:
    """Returns the place where another process finds a class; empty: nowhere."""
    if driver.__module__ == "__main__":
        file = getattr(sys.modules["__main__"], "__file__", None)
        return f"{Path(file).resolve()}:{driver.__qualname__}" if file else ""
    return f"{driver.__module__}:{driver.__qualname__}"


def source_of(driver: type[Any]) -> str:
    """Returns "file.py:Class", as in the provenance; empty if the class has no file."""
    try:
        file = inspect.getsourcefile(driver)
    except (OSError, TypeError):
        file = None
    return f"{Path(file).resolve()}:{driver.__qualname__}" if file else ""


def loaded(source: str) -> type[Any] | None:
    """Returns the class of this source that this process has loaded as a robot, or None."""
    return next((driver for driver in _libraries if source_of(driver) == source), None)


class DriverClass:
    """Describes a driver class for the compiled loop."""

    def __init__(self, driver: type[Any], place: str) -> None:
        """Raises InvalidArgument if the class is no driver."""
        check_verbs(driver)
        self._driver = driver
        self._options = Options.of(driver)
        self.path = place
        self.source = source_of(driver)
        name = getattr(driver, "name", None)
        self.name: str = name if isinstance(name, str) else _words(driver.__name__)
        self.built_with = f"o80 {_core.version()}; Python {platform.python_version()}"
        self.has_wait = hasattr(driver, "wait")
        self.has_halt = hasattr(driver, "halt")
        self.has_resume = hasattr(driver, "resume")

    @property
    def options(self) -> list[list[str]]:
        """Name, kind, default, help and unit of each option."""
        return self._options.rows

    def config(self, texts: Sequence[tuple[str, str]]) -> Any:
        """Makes the Config from options, or None. Raises InvalidArgument for wrong options."""
        values = self._options.values(texts)
        return None if self._options.config is None else self._options.config(**values)

    def make(self, texts: Sequence[tuple[str, str]]) -> Adapter:
        """Makes a driver object."""
        config = self.config(texts)
        return Adapter(self._driver() if config is None else self._driver(config), self.name)


_libraries: dict[type[Any], _core.RobotLibrary] = {}


def library_of(driver: type[Any], place: str | None = None) -> _core.RobotLibrary:
    """Makes a driver class a robot, once per class. Raises DriverError for an invalid class."""
    if driver not in _libraries:
        try:
            described = DriverClass(driver, place or place_of(driver))
        except InvalidArgument as error:
            raise DriverError(str(error)) from None
        _libraries[driver] = _core.python_library(described, described.source.rpartition(":")[0])
    return _libraries[driver]


def _words(name: str) -> str:
    """Converts "BallTracker" to ball_tracker."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name).lower()
