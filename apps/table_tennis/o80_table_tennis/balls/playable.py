"""Which shots a player can return: those that pass the net, bounce once and come within reach."""

from __future__ import annotations

import math
from collections.abc import Iterator
from enum import Enum

from ..physics.aerodynamics import AERODYNAMICS, State, runge_kutta_step
from ..physics.impact import bounced
from ..world.arm import FOREARM, SHOULDER, UPPER_ARM
from ..world.ball import BALL_RADIUS
from ..world.scene import Vector
from ..world.table import NET_HEIGHT, TABLE
from .launches import Launch

REACH = UPPER_ARM + FOREARM + 0.063
"""How near to the shoulder a ball must come [m]: the recorded shots of the ball gun, which can all
be returned, come to 0.51 to 0.79 m; the blade reaches 0.094 m beyond its centre."""
STEP = 0.05
"""Of the integration [s]; the error stays below 0.1 mm."""
MOST_LEGS = 40
"""A flight that has not come within reach after so many steps does not."""
PASSED = -0.8
"""A ball that is nearer to the wall behind the arm than this has passed it [m]."""

_NET_Y = TABLE.centre[1]
_NET_TOP = TABLE.top + NET_HEIGHT + BALL_RADIUS
_DRAG = AERODYNAMICS.drag
_HALFWAY = math.exp(-AERODYNAMICS.spin_decay * STEP / 2)
"""What is left of a spin after half a step."""


class Verdict(Enum):
    """Whether a shot can be played, or why not."""

    PLAYABLE = "playable"
    NET = "it does not pass above the net"
    NO_BOUNCE = "it misses the player's half of the table"
    TWO_BOUNCES = "it bounces twice before it comes within reach"
    OUT_OF_REACH = "it does not come within reach"


def verdict(launch: Launch) -> Verdict:
    """Of a shot, by its predicted flight until it comes within reach."""
    bounced_once = False
    for before, after, touches in _legs(launch):
        if bounced_once and _passes(before, after):
            return Verdict.PLAYABLE
        if before[1] >= _NET_Y > after[1] and _height_at_net(before, after) < _NET_TOP:
            return Verdict.NET
        if bounced_once and touches:
            return Verdict.TWO_BOUNCES
        if not bounced_once and after[2] <= TABLE.bounce_height:
            if not touches or after[1] >= _NET_Y:
                return Verdict.NO_BOUNCE
            bounced_once = True
        if after[1] < PASSED:
            break
    return Verdict.OUT_OF_REACH


def _legs(launch: Launch) -> Iterator[tuple[State[float], State[float], bool]]:
    """The flight in pieces: the state at both ends, and whether the later one touches the table."""
    x, y, z = launch.position.tolist()
    vx, vy, vz = launch.velocity.tolist()
    wx, wy, wz = launch.spin.tolist()
    state, spin = (x, y, z, vx, vy, vz), (wx, wy, wz)
    for _ in range(MOST_LEGS):
        after, spin_after = _later(state, spin)
        touch = _touch(after) if state[2] > TABLE.bounce_height >= after[2] else None
        if touch is None:
            yield state, after, False
            state, spin = after, spin_after
        else:
            yield state, touch, True
            state, spin = bounced(touch, spin_after)


def _later(state: State[float], spin: Vector) -> tuple[State[float], Vector]:
    """State and spin after a step of free flight, with the spin of its middle."""
    wx, wy, wz = spin
    share = AERODYNAMICS.magnus * _HALFWAY
    turn = (share * wx, share * wy, share * wz)
    halved_at = AERODYNAMICS.halved_at(_HALFWAY * math.sqrt(wx * wx + wy * wy + wz * wz))
    flown = runge_kutta_step(state, turn, _DRAG, AERODYNAMICS.gravity, STEP, halved_at)
    decay = _HALFWAY * _HALFWAY
    return flown, (decay * wx, decay * wy, decay * wz)


def _height_at_net(before: State[float], after: State[float]) -> float:
    """By a parabola through both states."""
    share = (before[1] - _NET_Y) / (before[1] - after[1])
    sag = share * (1.0 - share) * STEP * (before[5] - after[5]) / 2.0
    return before[2] + share * (after[2] - before[2]) + sag


def _touch(below: State[float]) -> State[float] | None:
    """The state at the touch of the table, a moment before one below it; None beside the table."""
    x, y, z, vx, vy, vz = below
    risen, gravity = TABLE.bounce_height - z, AERODYNAMICS.gravity
    time = (-vz - math.sqrt(max(vz * vz - 2.0 * gravity * risen, 0.0))) / gravity
    x, y = x - vx * time, y - vy * time
    if not TABLE.carries(x, y):
        return None
    return (x, y, TABLE.bounce_height, vx, vy, vz + gravity * time)


def _passes(before: State[float], after: State[float]) -> bool:
    """Whether the straight way between two states comes within reach of the shoulder."""
    x, y, z = before[0], before[1], before[2] - SHOULDER
    dx, dy, dz = after[0] - x, after[1] - y, after[2] - before[2]
    along = -(x * dx + y * dy + z * dz) / max(dx * dx + dy * dy + dz * dz, 1e-12)
    share = min(max(along, 0.0), 1.0)
    px, py, pz = x + share * dx, y + share * dy, z + share * dz
    return px * px + py * py + pz * pz < REACH * REACH
