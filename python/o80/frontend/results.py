"""Results of a frontend that most programs never see: halts, running requests, previews."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from o80.rows.record import States


@dataclass(frozen=True)
class Halt:
    """A halt that is in force, or requested."""

    number: int  #: argument of `Frontend.resume`
    cause: (
        str  #: frontend, driver, silence, dead_frontend, error, overruns, predecessor, unreachable
    )
    iteration: int | None  #: in which it began; None if it is requested and not yet in force
    who: str  #: the process that requested it; empty if the backend did
    text: str  #: the reason in words


def halt_of(fields: tuple[int, str, int, str, str]) -> Halt:
    """A halt from its fields, as C++ gives them."""
    number, cause, iteration, who, text = fields
    return Halt(number, cause, None if iteration < 0 else iteration, who, text)


@dataclass(frozen=True)
class RunningRequest:
    """A request that was answered with Running and has not ended."""

    name: str
    since: int  #: iteration in which it was taken
    who: str  #: the process that sent it
    progress: str  #: the driver's text


@dataclass(frozen=True, eq=False)
class Preview:
    """Preview of a command: the answer of Frontend.preview."""

    iterations: int  #: number of iterations that it takes
    late: int  #: by how many of them it takes longer than requested, at most 65535
    text: str  #: why, as `Handle.text` says it; empty if it is not late
    #: the desired states of all actuators, as in History.desired: (iterations, actuators), or a
    #: record of groups
    rows: "States" = field(repr=False)
