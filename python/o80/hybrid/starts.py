"""Returns robots that are stepped to the start of an episode."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.base.errors import InvalidArgument
from o80.frontend.frontend import Frontend
from o80.groups.inline_group import InlineGroup
from o80.hybrid.mirror import Reader
from o80.hybrid.sides import Side
from o80.rows.columns import columns_at

Numbers = NDArray[np.intp]
BURST = 20
"""Iterations of a burst on the way home: equal for each pacing, for equal bits."""


@dataclass(frozen=True)
class Home:
    """Start position of episodes."""

    place: Sequence[float] | None
    """Targets of all actuators; None: the position after a reset."""
    duration: float
    """Time of the motion to it [s]."""
    tolerance: float
    """Largest distance from it after the motion, in the units of the robot."""


class Starts:
    """Begins episodes of robots that are stepped.

    Without a home the request reset is used. With a home a copy moves there once; later a snapshot
    restores it, if the robot serves that.
    """

    def __init__(self, member: InlineGroup | Frontend, side: Side, copies: int, home: Home) -> None:
        self._member, self._side, self._home = member, side, home
        schema = side.schema
        self.resets, self._restores = side.serves("reset"), side.serves("restore")
        self.shows = self._restores if home.place is not None else self.resets
        """Whether `begin` leaves the newest rows in `side`."""
        self._settled = np.zeros(copies, np.bool_)
        if home.place is None:
            return
        if np.shape(home.place) != (len(schema["actuators"]),):
            raise InvalidArgument(
                f"home must have a number for each of the {len(schema['actuators'])} actuators, "
                f"got {home.place!r}"
            )
        self._burst: Any = member.prepared_burst(BURST, mode="overwrite")
        self._burst.targets[...] = home.place

    def begin(self, copies: Numbers, seeds: Sequence[int], period: float) -> None:
        """Begins episodes of these copies. Raises InvalidArgument if one does not reach home."""
        if self._home.place is None:
            self._reset(copies, seeds)
            return
        away = copies[~self._settled[copies]]
        if away.size:
            self._reset(away, [0] * len(away))
            for _ in range(math.ceil(self._home.duration / period / BURST)):
                self._run(away)
            self._check(away)
        if self._restores:
            if away.size:
                self._side.request("snapshot", away, slot=0)
                self._settled[away] = True
            self._side.repeat("restore", copies, slot=0)

    def _reset(self, copies: Numbers, seeds: Sequence[int]) -> None:
        if self.resets:
            self._side.repeat("reset", copies, seed=seeds)

    def _run(self, copies: Numbers) -> None:
        if isinstance(self._member, InlineGroup):
            self._burst.run(copies)
        else:
            self._burst.run()

    def _check(self, copies: Numbers) -> None:
        rows = self._burst.rows[copies] if self._burst.rows.ndim > 1 else self._burst.rows[None]
        there = Reader(columns_at(self._side.schema, "observed"))(rows[:, -1])
        wanted = np.asarray(self._home.place)
        if there.shape[1:] != wanted.shape:
            return  # states of several numbers
        apart = np.abs(there - wanted).max(axis=1)
        if (far := apart > self._home.tolerance).any():
            raise InvalidArgument(
                f"copy {copies[far][0]} is {apart[far][0]:.3g} away from home after "
                f"{self._home.duration:g} s: give a longer home_duration, or a larger "
                "home_tolerance"
            )
