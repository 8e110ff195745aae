"""Which robot has a Frontend class of its own."""

from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from o80.frontend import Frontend

GROUP = "o80.frontends"

_registered: dict[str, type["Frontend"]] = {}


@cache
def _packaged() -> dict[str, EntryPoint]:
    """Those that installed packages announce, by the robot's name."""
    return {point.name: point for point in entry_points(group=GROUP)}


def register_frontend(robot: str, cls: type["Frontend"]) -> None:
    """Makes `o80.Frontend` return a subclass for segments of that robot.

    A package does the same with an entry point of the group "o80.frontends".
    """
    _registered[robot] = cls


def of(robot: str) -> type["Frontend"] | None:
    """The class of that robot, or None."""
    if robot not in _registered and robot in _packaged():
        _registered[robot] = _packaged()[robot].load()
    return _registered.get(robot)
