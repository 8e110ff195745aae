"""How a frontend computes what a command would do."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, SupportsIndex

import numpy as np

from o80.frontend.commanding import Commanding

if TYPE_CHECKING:
    from o80.base.words import ProfileWord, StartWord
    from o80.frontend.preview import Preview


class Previewing(Commanding):
    """The part of o80.Frontend that computes what a command would do."""

    def preview(
        self,
        actuator: SupportsIndex | str | Sequence[SupportsIndex | str] | None,
        target: Any,
        *,
        duration: float | None = None,
        speed: float | None = None,
        until: int | None = None,
        iterations: int | None = None,
        fastest: bool = False,
        profile: ProfileWord | None = None,
        start: StartWord = "desired",
        every: float | int | None = None,
        initial: Any = None,
    ) -> Preview:
        """Computes what `add_command` with the same arguments would do after the newest row.

        The code of the loop computes it here, so the robot does the same bit for bit. Sends
        nothing, adds nothing, works read-only.

        actuator, target, duration, speed, until, iterations, fastest, profile, start, every: as in
            add_command.
        initial: the state from which it begins at rest, in the form of `target`. Fields that are
            left out, and with None all, begin as they are in the newest row.

        With None, fields of type float64 with acceleration limits begin with the velocity and
        acceleration of the last three rows, other fields at rest. Commands that run or wait do not
        count. Actuators without a target are shown as if they had no command.

        Raises InvalidArgument as add_command, for an `until` that has passed, for a motion of more
        than a million iterations, for states that the driver interpolates in C++ (`blend`), and for
        fields with the bound of an integral, which depends on what will be observed.
        """
        late, text, desired = self._preview(
            actuator,
            target,
            initial,
            duration,
            speed,
            until,
            iterations,
            fastest,
            profile,
            start,
            every,
        )
        rows = np.frombuffer(desired, np.dtype([("desired", self._layout.states)]))
        from o80.frontend.preview import Preview

        return Preview(len(rows), late, text, self._layout.many(rows, "desired"))
