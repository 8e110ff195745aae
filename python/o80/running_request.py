"""Requests that a driver serves over several iterations."""

from dataclasses import dataclass


@dataclass(frozen=True)
class RunningRequest:
    """A request that has begun and not ended."""

    name: str
    since: int  #: iteration in which it was taken
    who: str  #: the process that sent it
    progress: str  #: what the driver says of it
