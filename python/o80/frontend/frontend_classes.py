"""Frontend classes for single robots."""

from typing import TYPE_CHECKING

from o80.base.entry_points import announced

if TYPE_CHECKING:
    from o80.frontend.frontend import Frontend

GROUP = "o80.frontends"

_registered: dict[str, type["Frontend"]] = {}


def register_frontend(robot: str, cls: type["Frontend"]) -> None:
    """Registers a subclass that `o80.Frontend(...)` returns for segments of this robot.

    A package can do the same with an entry point of the group "o80.frontends".
    """
    _registered[robot] = cls


def of(robot: str) -> type["Frontend"] | None:
    """The class of that robot, or None."""
    if robot not in _registered and robot in announced(GROUP):
        _registered[robot] = announced(GROUP)[robot].load()
    return _registered.get(robot)
