"""Outcome of a touched ball: whether it was returned, and the end of its flight.

A ball is **returned** if its first contact after the racket's touch is a landing on top of the
table beyond the net. A ball that touched the net before, first landed on the player's own
half, or hit a side of the table is not returned, whatever follows. Neither the number of
touches of the racket nor earlier bounces matter: a ball may be volleyed.
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
"""Tolerance of a landing on the table's top [m]."""

# math and NumPy differ in the last bit: one episode and many must have the same rewards
_hypot = np.frompyfunc(math.hypot, 2, 1)


def on_top(record: BallRecord) -> Any:
    """Flags (...) of landings on top of the table, not at its side."""
    return np.asarray(record.landing)[..., 2] > TABLE.top - SMALL


def beyond_net(record: BallRecord) -> Any:
    """Flags (...) of landings on the opponent's side of the net."""
    return np.asarray(record.landing)[..., 1] > NET_Y


def returned(record: BallRecord) -> Any:
    """Flags (...) of returned balls, see the module."""
    legal = np.logical_not(record.touched_net) & on_top(record) & beyond_net(record)
    return record.touched & record.landed & legal


def ended_at(state: State) -> FloatArray:
    """Ends (..., 3) of touched balls' flights: first contact with net, table or floor after the
    touch, or the present place [m].
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
    """Distances (...) of places (..., 2+) from targets (..., 2+), in the table's plane [m]."""
    apart = np.asarray(place)[..., :2] - np.asarray(target)[..., :2]
    return np.asarray(_hypot(apart[..., 0], apart[..., 1]), dtype=np.float64)


def outcome(record: BallRecord, target: Any) -> dict[str, Any]:
    """Returns infos: `touched`, `returned`, `landing` (..., 3), its `distance` from the target.

    `landing` is the first contact with the table after the touch, on either half; before, landing
    and distance are infinite, not NaN, because Gymnasium's checks compare infos for
    equality. The arrays may be views, or shared and read-only.
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
    """Returns `returned`, `landing` and `distance` of balls that have not landed."""
    nowhere = np.full((*shape, 3), np.inf)
    returned, apart = np.zeros(shape, np.bool_), np.full(shape, np.inf)
    for array in (nowhere, returned, apart):
        array.flags.writeable = False
    return returned, nowhere, apart
