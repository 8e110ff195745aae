"""How a frontend moves a robot and waits until it is observed there."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, SupportsIndex, TypeAlias

import o80._core as _core
from o80.base.words import ModeWord, ProfileWord, StartWord
from o80.frontend.previewing import Previewing

#: A number, a mapping from fields to numbers, or one of these for each actuator.
Tolerance: TypeAlias = float | Mapping[str, Any] | Sequence[float | Mapping[str, Any]]


class Moving(Previewing):
    """The part of o80.Frontend that moves a robot until it is observed at its targets."""

    if TYPE_CHECKING:

        def move_to(
            self,
            actuators: SupportsIndex | str | Sequence[SupportsIndex | str] | None,
            targets: Any,
            *,
            tolerance: Tolerance,
            timeout: float | None = None,
            duration: float | None = None,
            speed: float | None = None,
            until: int | None = None,
            iterations: int | None = None,
            fastest: bool = False,
            mode: ModeWord = "queue",
            profile: ProfileWord | None = None,
            start: StartWord = "desired",
        ) -> _core.Observation:
            """Sends a command at once and waits until the robot is observed at its targets.

            actuators, targets, duration, speed, until, iterations, fastest, mode, profile, start:
                as in add_command.
            tolerance: largest distance between observed and target, in the unit of the field: a
                number for all fields that have a target, a mapping from fields to numbers (other
                fields are not judged), or a sequence with one of these for each actuator.
                Booleans and enumerations must be equal.
            timeout: how long to wait [s].

            It first waits until the command has ended. It needs no pulse; what was added and not
            pulsed stays added. A bursting backend runs until the robot is there; `timeout` is then
            time of the robot (iterations x period), so that a script always ends alike.

            Returns the observation in which it was within the tolerance. Raises NotReached after
            the timeout, which says where the robot is; commands that have not ended continue.
            Raises NotCompleted if the command ended otherwise than completed, BackendHalted,
            BackendGone, InvalidArgument, and the exceptions of pulse.
            """
