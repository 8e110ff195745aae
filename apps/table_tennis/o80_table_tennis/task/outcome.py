"""Outcome of a touched ball: whether it was returned, and where its flight ended.

A ball is **returned** if, after the racket touched it, it met nothing before it landed on top of
the table beyond the net. A ball that touched the net on the way, landed first on the player's own
half, or met a side of the table is not returned, wherever it went then. Neither the number of
touches of the racket nor the bounces before the first one matter: a ball may be volleyed.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np

from o80.base.arrays import FloatArray

from ..world.table import NET_Y, TABLE
from .ball_record import BallRecord
from .state import State

SMALL = 1e-6
"""A landing this far below the top of the table is still on top of it [m]."""

# of math, not of NumPy, which differ in the last bit: one episode and many get the same rewards
_hypot = np.frompyfunc(math.hypot, 2, 1)


def on_top(record: BallRecord) -> Any:
    """(...) whether a ball that has landed did so on top of the table, not at its side."""
    return np.asarray(record.landing)[..., 2] > TABLE.top - SMALL


def beyond_net(record: BallRecord) -> Any:
    """(...) whether a ball that has landed did so on the opponent's side of the net."""
    return np.asarray(record.landing)[..., 1] > NET_Y


def returned(record: BallRecord) -> Any:
    """(...) whether the ball was returned, see the module."""
    legal = np.logical_not(record.touched_net) & on_top(record) & beyond_net(record)
    return record.touched & record.landed & legal


def ended_at(state: State) -> FloatArray:
    """(..., 3) where the flight of a touched ball ended: where it first met net, table or floor
    after the touch, or where the ball is now [m].
    """
    record = state.record
    place = np.asarray(state.ball)[..., :3]
    for met, there in (
        (record.touched_floor, record.floor_position),
        (record.landed, record.landing),
        (record.touched_net, record.net_position),
    ):
        place = np.where(np.asarray(met)[..., np.newaxis], there, place)
    return place


def distance(place: Any, target: Any) -> FloatArray:
    """(...) of places (..., 2+) from targets (..., 2+), in the plane of the table [m]."""
    apart = np.asarray(place)[..., :2] - np.asarray(target)[..., :2]
    return np.asarray(_hypot(apart[..., 0], apart[..., 1]), dtype=np.float64)


def outcome(record: BallRecord, target: Any) -> dict[str, Any]:
    """`touched`, `returned`, `landing` (..., 3) and its `distance` from the target, as infos.

    `landing` is where the ball touched the table after the touch, on whichever half; before that,
    landing and distance are infinite. Not NaN: Gymnasium's checks want equal infos to compare
    equal. The arrays may be views, or shared and read-only.
    """
    landed = record.landed
    if not np.count_nonzero(landed):
        is_returned, nowhere, apart = _unlanded(np.shape(landed))
    else:
        nowhere = np.where(np.asarray(landed)[..., np.newaxis], record.landing, np.inf)
        is_returned, apart = returned(record), distance(nowhere, target)
    return {
        "touched": record.touched,
        "returned": is_returned,
        "landing": nowhere,
        "distance": apart,
    }


@cache
def _unlanded(shape: tuple[int, ...]) -> tuple[Any, FloatArray, Any]:
    """`returned`, `landing` and `distance` of balls that have not landed."""
    nowhere = np.full((*shape, 3), np.inf)
    returned, apart = np.zeros(shape, np.bool_), np.full(shape, np.inf)
    for array in (nowhere, returned, apart):
        array.flags.writeable = False
    return returned, nowhere, apart
