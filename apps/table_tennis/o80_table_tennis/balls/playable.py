"""Which shots a player can return: those that pass the net, bounce once and come within reach."""

from __future__ import annotations

import math
from collections.abc import Iterator
from enum import Enum

from ..physics.aerodynamics import AERODYNAMICS, State
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
_DECAY = _HALFWAY * _HALFWAY
_TURN = AERODYNAMICS.magnus * _HALFWAY
_HALVED_AT = AERODYNAMICS.halved_at(1.0)
_GRAVITY = AERODYNAMICS.gravity
_HALF, _THIRD, _SIXTH = STEP / 2, STEP / 3, STEP / 6
_BOUNCE_HEIGHT = TABLE.bounce_height


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
        if not bounced_once and after[2] <= _BOUNCE_HEIGHT:
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
        touch = _touch(after) if state[2] > _BOUNCE_HEIGHT >= after[2] else None
        if touch is None:
            yield state, after, False
            state, spin = after, spin_after
        else:
            yield state, touch, True
            state, spin = bounced(touch, spin_after)


def _later(state: State[float], spin: Vector) -> tuple[State[float], Vector]:
    """State and spin after a step of free flight, with the spin of its middle.

    The same as `aerodynamics.runge_kutta_step`, bit for bit, written out for speed: each drawn
    shot takes about sixteen of these steps.
    """
    x, y, z, vx, vy, vz = state
    wx, wy, wz = spin
    turn = _TURN * wx, _TURN * wy, _TURN * wz
    halved_at = _HALVED_AT * (_HALFWAY * math.sqrt(wx * wx + wy * wy + wz * wz))
    ax, ay, az = _acceleration(vx, vy, vz, turn, halved_at)
    bx, by, bz = vx + _HALF * ax, vy + _HALF * ay, vz + _HALF * az
    bax, bay, baz = _acceleration(bx, by, bz, turn, halved_at)
    cx, cy, cz = vx + _HALF * bax, vy + _HALF * bay, vz + _HALF * baz
    cax, cay, caz = _acceleration(cx, cy, cz, turn, halved_at)
    dx, dy, dz = vx + STEP * cax, vy + STEP * cay, vz + STEP * caz
    dax, day, daz = _acceleration(dx, dy, dz, turn, halved_at)
    flown = (
        x + _SIXTH * vx + _THIRD * bx + _THIRD * cx + _SIXTH * dx,
        y + _SIXTH * vy + _THIRD * by + _THIRD * cy + _SIXTH * dy,
        z + _SIXTH * vz + _THIRD * bz + _THIRD * cz + _SIXTH * dz,
        vx + _SIXTH * ax + _THIRD * bax + _THIRD * cax + _SIXTH * dax,
        vy + _SIXTH * ay + _THIRD * bay + _THIRD * cay + _SIXTH * day,
        vz + _SIXTH * az + _THIRD * baz + _THIRD * caz + _SIXTH * daz,
    )
    return flown, (_DECAY * wx, _DECAY * wy, _DECAY * wz)


def _acceleration(vx: float, vy: float, vz: float, turn: Vector, halved_at: float) -> Vector:
    """As that of `aerodynamics.derivative` [m/s^2]."""
    tx, ty, tz = turn
    speed = (vx * vx + vy * vy + vz * vz) ** 0.5
    slowing = _DRAG * speed
    if halved_at > 0.0:
        share = speed / (speed + halved_at)
        tx, ty, tz = share * tx, share * ty, share * tz
    return (
        ty * vz - tz * vy - slowing * vx,
        tz * vx - tx * vz - slowing * vy,
        tx * vy - ty * vx - slowing * vz - _GRAVITY,
    )


def _height_at_net(before: State[float], after: State[float]) -> float:
    """By a parabola through both states."""
    share = (before[1] - _NET_Y) / (before[1] - after[1])
    sag = share * (1.0 - share) * STEP * (before[5] - after[5]) / 2.0
    return before[2] + share * (after[2] - before[2]) + sag


def _touch(below: State[float]) -> State[float] | None:
    """The state at the touch of the table, a moment before one below it; None beside the table."""
    x, y, z, vx, vy, vz = below
    risen, gravity = _BOUNCE_HEIGHT - z, _GRAVITY
    time = (-vz - math.sqrt(max(vz * vz - 2.0 * gravity * risen, 0.0))) / gravity
    x, y = x - vx * time, y - vy * time
    if not TABLE.carries(x, y):
        return None
    return (x, y, _BOUNCE_HEIGHT, vx, vy, vz + gravity * time)


def _passes(before: State[float], after: State[float]) -> bool:
    """Whether the straight way between two states comes within reach of the shoulder."""
    x, y, z = before[0], before[1], before[2] - SHOULDER
    dx, dy, dz = after[0] - x, after[1] - y, after[2] - before[2]
    along = -(x * dx + y * dy + z * dz) / max(dx * dx + dy * dy + dz * dz, 1e-12)
    share = min(max(along, 0.0), 1.0)
    px, py, pz = x + share * dx, y + share * dy, z + share * dz
    return px * px + py * py + pz * pz < REACH * REACH
