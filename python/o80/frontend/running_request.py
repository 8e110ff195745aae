"""Requests that a driver serves over several iterations."""

from dataclasses import dataclass


@dataclass(frozen=True)
class RunningRequest:
    """A request that was answered with Running and has not ended."""

    name: str
    since: int  #: iteration in which it was taken
    who: str  #: the process that sent it
    progress: str  #: the driver's text
