"""Results of rarely used calls of a frontend: halts, running requests, previews."""

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
    iteration: int | None  #: first iteration of the halt; None: requested and not yet in force
    who: str  #: process that requested it; empty if the backend did
    text: str  #: reason in words


def halt_of(fields: tuple[int, str, int, str, str]) -> Halt:
    """Makes a halt from its fields in C++."""
    number, cause, iteration, who, text = fields
    return Halt(number, cause, None if iteration < 0 else iteration, who, text)


@dataclass(frozen=True)
class RunningRequest:
    """A request that was answered with Running and has not ended."""

    name: str
    since: int  #: iteration in which it was taken
    who: str  #: process that sent it
    progress: str  #: the driver's text


@dataclass(frozen=True, eq=False)
class Preview:
    """Preview of a command: the result of Frontend.preview."""

    iterations: int  #: number of iterations that it takes
    late: int  #: iterations by which it takes longer than requested, at most 65535
    text: str  #: the reason, as in `Handle.text`; empty if it is not late
    #: the desired states of all actuators, as in History.desired: (iterations, actuators), or a
    #: record of groups
    rows: "States" = field(repr=False)
