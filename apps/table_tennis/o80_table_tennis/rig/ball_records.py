"""The balls of a twin: the options that describe them, and the records that it publishes of each.

No other module knows how the simulator names what happens to a ball.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..physics.aerodynamics import AERODYNAMICS
from ..task.ball_record import BallRecord
from ..world.ball import BALL_GUN_SPIN
from ..world.materials import (
    FLOOR_RESTITUTION,
    NET_RESTITUTION,
    RACKET_RESTITUTION,
    TABLE_RESTITUTION,
)

RECORDS = ("extended", "contacts")
"""Where in a row of the twin the records of its balls are."""
TOUCHES = ("racket", "count")
NET_TOUCHES = ("net", "count")
FLOOR_TOUCHES = ("floor", "count")
"""Paths inside a record,"""
LANDED_AT = ("table", "iteration")
NET_AT = ("net", "iteration")
"""when the ball touched table and net after the racket, or -1,"""
LANDING = ("table", "position")
NET_POSITION = ("net", "position")
FLOOR_POSITION = ("floor", "position")
"""where it did,"""
VELOCITY_AFTER = ("racket", "velocity_after")
"""of the first contact with the racket,"""
LARGEST_SPEED = ("racket", "largest_speed")
SMALLEST_DISTANCE = ("racket", "smallest_distance")

READ = {
    *(TOUCHES, NET_TOUCHES, FLOOR_TOUCHES, LANDED_AT, NET_AT),
    *(LANDING, NET_POSITION, FLOOR_POSITION),
    *(VELOCITY_AFTER, LARGEST_SPEED, SMALLEST_DISTANCE),
}
FAR = 1e9
"""[m]"""
CODES = {"i8": "q", "f8": "d"}
"""Codes of numbers for `struct`."""


SURFACES = {
    "racket": RACKET_RESTITUTION,
    "table": TABLE_RESTITUTION,
    "net": NET_RESTITUTION,
    "floor": FLOOR_RESTITUTION,
}
"""Surfaces that balls bounce on, by the names of geoms; to the simulator they are all alike."""


def ball_options(balls: int) -> dict[str, Any]:
    """Options of the simulator for so many balls, for the air, and for what they bounce on."""
    return {
        "balls": "ball",
        "extra_balls": balls - 1,
        "surfaces": [f"{geom}={restitution.text}" for geom, restitution in SURFACES.items()],
        "watched": "racket",
        "air_density": AERODYNAMICS.air_density,
        "drag_coefficient": AERODYNAMICS.drag_coefficient,
        "lift_coefficient": AERODYNAMICS.lift_coefficient,
        "lift_saturation": AERODYNAMICS.lift_saturation,
        "spin_decay": AERODYNAMICS.spin_decay,
        "spin": BALL_GUN_SPIN,
    }


def fly_out_fields(*, every: int, passed_y: float) -> dict[str, Any]:
    """Fields of the request `fly_out` of a twin: its first ball flies until it has bounced off
    table, net or floor, or has passed y [m], both looked at every `every` iterations.
    """
    return {"every": every, "low": (-FAR, passed_y, -FAR)}


class BallReader:
    """Reads the record of one ball out of the bytes of a row, without NumPy: that is faster.

    `dtype` is that of a record, `offset` where it lies in the row [bytes].
    """

    def __init__(self, dtype: np.dtype[Any], offset: int) -> None:
        codes, places, count = "=", {}, 0
        for path, numbers in _numbers(dtype):
            if path in READ:
                places[path] = count
                size = int(np.prod(numbers.shape))
                codes += f"{size}{CODES[numbers.base.str[1:]]}"
                count += size
            else:
                codes += f"{numbers.itemsize}x"
        self._struct = struct.Struct(codes)
        self._offset = offset
        assert self._struct.size == dtype.itemsize, "a record with gaps"
        self._touches, self._net, self._floor = (
            places[path] for path in (TOUCHES, NET_TOUCHES, FLOOR_TOUCHES)
        )
        self._landed, self._net_at = places[LANDED_AT], places[NET_AT]
        self._landing, self._net_position, self._floor_position = (
            _vector_at(places[path]) for path in (LANDING, NET_POSITION, FLOOR_POSITION)
        )
        self._after = _vector_at(places[VELOCITY_AFTER])
        self._speed, self._distance = places[LARGEST_SPEED], places[SMALLEST_DISTANCE]

    def read(self, row: Any) -> BallRecord:
        """Reads what has happened to the ball; `row` is any buffer."""
        seen = self._struct.unpack_from(row, self._offset)
        landed, net_at = seen[self._landed], seen[self._net_at]
        return BallRecord(
            seen[self._distance],
            seen[self._touches] > 0,
            seen[self._after],
            seen[self._speed],
            landed >= 0,
            seen[self._landing],
            seen[self._net] > 0 and not 0 <= landed < net_at,
            seen[self._floor] > 0,
            seen[self._net_position],
            seen[self._floor_position],
        )


FLAGS = {
    "touched": (TOUCHES, ">", 0),
    "landed": (LANDED_AT, ">=", 0),
    "met_net": (NET_TOUCHES, ">", 0),
    "touched_floor": (FLOOR_TOUCHES, ">", 0),
}
"""Flags that a group gathers of the first ball of each row."""


def event_flags() -> dict[str, Any]:
    """The flags of `BallRecords`, for `InlineGroup.gather`."""
    first = f"{RECORDS[0]}.{RECORDS[1]}[0]"
    return {
        name: (f"{first}.{'.'.join(path)}", compare, value)
        for name, (path, compare, value) in FLAGS.items()
    }


class BallRecords:
    """The records (N,) of N balls, an array that is filled anew for each reading.

    `flags` are those of `event_flags`, which are filled anew at the same time.
    """

    def __init__(self, records: NDArray[Any], flags: Mapping[str, NDArray[np.bool_]]) -> None:
        at = {path: _values(records, path) for path in READ}
        self._landed_at, self._net_at = at[LANDED_AT], at[NET_AT]
        self._landed, self._met_net = flags["landed"], flags["met_net"]
        self._nobody = np.zeros(len(records), np.bool_)
        self._nobody.flags.writeable = False
        self._record = BallRecord(
            at[SMALLEST_DISTANCE],
            flags["touched"],
            at[VELOCITY_AFTER],
            at[LARGEST_SPEED],
            flags["landed"],
            at[LANDING],
            self._nobody,
            flags["touched_floor"],
            at[NET_POSITION],
            at[FLOOR_POSITION],
        )

    def read(self) -> BallRecord:
        """Reads what has happened to the balls; all arrays but `touched_net` are views."""
        record = self._record
        if np.count_nonzero(self._met_net):
            late = self._landed & (self._landed_at < self._net_at)
            record.touched_net = self._met_net & ~late
        else:
            record.touched_net = self._nobody
        return record


def ball_records(records: NDArray[Any]) -> BallRecord:
    """Events of N balls, from their records (N,)."""
    compare = {">": np.greater, ">=": np.greater_equal}
    flags = {
        name: compare[how](_values(records, path), value)
        for name, (path, how, value) in FLAGS.items()
    }
    return BallRecords(records, flags).read()


def _values(records: NDArray[Any], path: tuple[str, ...]) -> NDArray[Any]:
    for name in path:
        records = records[name]
    return records


def _vector_at(place: int) -> slice:
    return slice(place, place + 3)


def _numbers(
    dtype: np.dtype[Any], path: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], np.dtype[Any]]]:
    """Path and type of every number or array of numbers in a record, in order."""
    if dtype.fields is None:
        yield path, dtype
        return
    for name in dtype.names or ():
        yield from _numbers(dtype.fields[name][0], (*path, name))
