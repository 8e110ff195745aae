"""How a frontend describes its backend and robot.

Modules that most processes never need are imported when they are first used: each would make the
first attach up to 3 ms slower.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import o80._core as _core
from o80.base.cached import cached
from o80.rows.layout import Layout

if TYPE_CHECKING:
    from o80.base.words import LifeWord
    from o80.rows.actuators import Actuator
    from o80.rows.provenance import Provenance


class Describing(_core.Frontend):
    """The part of o80.Frontend that describes the robot."""

    _description: _core.Description
    _layout: Layout
    _decoder: _core.Decoder

    if TYPE_CHECKING:

        @property
        def segment(self) -> str:
            """The name of the segment."""

        @property
        def epoch(self) -> int:
            """The number of this run of the backend; another run of the same name has another."""

        @property
        def bursting(self) -> bool:
            """True if the backend runs only the iterations that frontends request."""

        @property
        def life(self) -> LifeWord:
            """starting, running, stopped, failed, superseded or killed."""

        @property
        def closed(self) -> bool:
            """True if this frontend was closed."""

    @property
    def alive(self) -> bool:
        """True while the backend runs or starts."""
        return self.life in ("starting", "running")

    @property
    def schema(self) -> dict[str, Any]:
        """The description of the robot."""
        return self._layout.schema

    @property
    def provenance(self) -> Provenance:
        """How the backend was started: options, versions, and the offset to the wall clock."""
        from o80.rows.provenance import Provenance

        return Provenance.from_fields(_core.provenance_fields(self))

    @property
    def robot(self) -> str:
        """The name of the robot."""
        name: str = self.schema["robot"]
        return name

    @property
    def model(self) -> str:
        """The model (MJCF) that draws the robot; empty if its driver names none."""
        return self._layout.model

    @cached
    def actuators(self) -> list[Actuator]:
        """The actuators: index, name, unit, limits."""
        from o80.rows.actuators import actuators_of
        from o80.rows.tables import Actuators

        return Actuators(actuators_of(self.schema), self.schema)

    @property
    def requests(self) -> dict[str, str]:
        """The requests that the driver serves, each with its help."""
        return {request["name"]: request["help"] for request in self.schema["requests"]}

    @property
    def enums(self) -> dict[str, Any]:
        """An IntEnum for each enumerated field, by its name."""
        return self._layout.enums

    @property
    def period(self) -> float:
        """Duration of an iteration [s]."""
        nanoseconds: int = self.schema["period"]
        return nanoseconds * 1e-9

    @property
    def frequency(self) -> float:
        """Iterations a second [1/s]."""
        nanoseconds: int = self.schema["period"]
        return 1e9 / nanoseconds
