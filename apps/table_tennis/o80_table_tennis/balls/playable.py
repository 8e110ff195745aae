"""Judges whether a shot can be returned: it passes the net, bounces once and comes within reach."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from itertools import pairwise

from ..physics.prediction import BOUNCED, STATE, STEP, TIME, flight_nodes
from ..world.arm import FOREARM, SHOULDER, UPPER_ARM
from ..world.ball import BALL_RADIUS
from ..world.table import NET_HEIGHT, TABLE
from .launches import Launch

REACH = UPPER_ARM + FOREARM + 0.063
"""Largest distance of a playable ball from the shoulder [m]: the recorded shots of the ball gun can
all be returned, and pass it at 0.51 to 0.79 m; the blade reaches 0.094 m beyond its centre."""
DURATION = 2.0
"""Time after which a flight counts as out of reach [s]; most are decided by `USUAL`."""
USUAL = 0.9
PASSED = -0.8
"""Largest y of a ball that has passed the arm [m]."""

_NET_Y = TABLE.centre[1]
_NET_TOP = TABLE.top + NET_HEIGHT + BALL_RADIUS
_LOWEST = TABLE.bounce_height - 1e-6  # a lower ball has missed the table
_X, _Y, _Z, _, _, _VZ = range(STATE.start, STATE.stop)


class Verdict(Enum):
    """Whether a shot can be played, or why not."""

    PLAYABLE = "playable"
    NET = "it does not pass above the net"
    NO_BOUNCE = "it misses the player's half of the table"
    TWO_BOUNCES = "it bounces twice before it comes within reach"
    OUT_OF_REACH = "it does not come within reach"


def verdict(launch: Launch, duration: float = USUAL) -> Verdict:
    """Judges a shot by its predicted flight until it comes within reach."""
    nodes = flight_nodes(launch.position, launch.velocity, launch.spin, duration)
    if duration < DURATION:  # the last step may be shorter than in the whole flight
        nodes = nodes[nodes[:, TIME] <= duration - STEP]
    bounced = False
    for before, after in pairwise(nodes.tolist()):
        if after[BOUNCED]:
            if bounced:
                return Verdict.TWO_BOUNCES
            if after[_Y] >= _NET_Y:
                return Verdict.NO_BOUNCE
            bounced = True
            continue
        if bounced and _passes(before, after):
            return Verdict.PLAYABLE
        if before[_Y] >= _NET_Y > after[_Y] and _height_at_net(before, after) < _NET_TOP:
            return Verdict.NET
        if not bounced and after[_Z] < _LOWEST:
            return Verdict.NO_BOUNCE
        if after[_Y] < PASSED:
            break
    else:
        if duration < DURATION:
            return verdict(launch, DURATION)
    return Verdict.OUT_OF_REACH if bounced else Verdict.NO_BOUNCE


def _height_at_net(before: Sequence[float], after: Sequence[float]) -> float:
    """Interpolates the height at the net by a parabola through both states."""
    share = (before[_Y] - _NET_Y) / (before[_Y] - after[_Y])
    time = after[TIME] - before[TIME]
    sag = share * (1.0 - share) * time * (before[_VZ] - after[_VZ]) / 2.0
    return before[_Z] + share * (after[_Z] - before[_Z]) + sag


def _passes(before: Sequence[float], after: Sequence[float]) -> bool:
    """Whether the straight line between two states comes within reach of the shoulder."""
    x, y, z = before[_X], before[_Y], before[_Z] - SHOULDER
    dx, dy, dz = after[_X] - x, after[_Y] - y, after[_Z] - before[_Z]
    along = -(x * dx + y * dy + z * dz) / max(dx * dx + dy * dy + dz * dz, 1e-12)
    share = min(max(along, 0.0), 1.0)
    px, py, pz = x + share * dx, y + share * dy, z + share * dz
    return px * px + py * py + pz * pz < REACH * REACH
