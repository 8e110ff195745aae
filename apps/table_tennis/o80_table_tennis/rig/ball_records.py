"""The balls of a twin: the options that describe them, and the records that it publishes of each.

No other module knows how the simulator names what happens to a ball.
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..task.rewards import BallRecord, End, EndRule, RewardRule


def ball_options(balls: int) -> dict[str, Any]:
    """Options of the simulator for so many balls, and for what they bounce on."""
    return {
        "balls": "ball",
        "extra_balls": balls - 1,
        "racket": "racket",
        "table": "table",
        "net": "net",
        "floor": "floor",
    }


CODES = {"u4": "I", "i8": "q", "f8": "d"}


class RecordReader:
    """Reads the record of one ball out of a row, as Python numbers.

    `dtype` is that of a record, `offset` where it lies in the row [bytes].
    """

    def __init__(self, dtype: np.dtype[Any], offset: int) -> None:
        assert dtype.names is not None
        assert dtype.fields is not None
        codes, self._places = "=", {}
        for name in dtype.names:
            field = dtype.fields[name][0]
            count = int(np.prod(field.shape))
            self._places[name] = len(struct.unpack(codes, bytes(struct.calcsize(codes))))
            codes += f"{count}{CODES[field.base.str[1:]]}"
        self._struct = struct.Struct(codes)
        self._offset = offset
        assert self._struct.size == dtype.itemsize, "a record with gaps"

    def place(self, name: str) -> int:
        """Of a value in what `read` returns; of its first number if it is a vector."""
        return self._places[name]

    def read(self, row: Any) -> tuple[Any, ...]:
        """All numbers of the record in the order of its fields; `row` is any buffer."""
        return self._struct.unpack_from(row, self._offset)


class BallWatch:
    """Watches the ball that is played."""

    def __init__(self, reader: RecordReader, *, end: EndRule, reward: RewardRule) -> None:
        self._read = reader.read
        self._end, self._reward = end, reward
        place = reader.place
        self._count, self._net, self._floor = (
            place("count"),
            place("net_count"),
            place("floor_count"),
        )
        self._after = place("velocity_after")
        self._distance, self._speed = place("smallest_distance"), place("largest_speed")
        self._landing, self._landed_at = place("landing_iteration"), place("landing_position")
        self._row: tuple[Any, ...] = ()

    def look(self, row: Any, y: float, steps: int) -> End:
        """Reads a row (a buffer) in which the ball is at `y` [m], after so many steps."""
        self._row = seen = self._read(row)
        quiet = seen[self._landing] < 0 and not seen[self._net] and not seen[self._floor]
        if quiet and y >= self._end.passed_y and steps < self._end.most_steps:
            return End.RUNNING
        return self._end.judge(self._record(y), steps)

    @property
    def hit(self) -> bool:
        """The racket has touched the ball."""
        return bool(self._row[self._count] > 0)

    @property
    def returned(self) -> bool:
        """The racket has touched the ball, and it flew back."""
        return self.hit and bool(self._row[self._after + 1] > 0)

    @property
    def smallest_distance(self) -> float:
        """Of the surfaces of ball and racket so far [m]."""
        distance: float = self._row[self._distance]
        return distance

    def reward(self, y: float) -> float:
        """What the episode is worth if it ends now."""
        return self._reward.reward(self._record(y))

    def _record(self, y: float) -> BallRecord:
        seen = self._row
        landed = seen[self._landing] >= 0
        return BallRecord(
            smallest_distance=seen[self._distance],
            y=y,
            hit=self.hit,
            landing=(seen[self._landed_at], seen[self._landed_at + 1]) if landed else None,
            touched_net=seen[self._net] > 0,
            touched_floor=seen[self._floor] > 0,
            largest_speed=seen[self._speed],
        )


def record_of(record: Any, y: float) -> BallRecord:
    """What the twin says about one ball, which is at `y` [m]."""
    landed = record["landing_iteration"] >= 0
    at = record["landing_position"]
    return BallRecord(
        smallest_distance=float(record["smallest_distance"]),
        y=y,
        hit=bool(record["count"] > 0),
        landing=(float(at[0]), float(at[1])) if landed else None,
        touched_net=bool(record["net_count"] > 0),
        touched_floor=bool(record["floor_count"] > 0),
        largest_speed=float(record["largest_speed"]),
    )


def touched_balls(records: NDArray[Any]) -> NDArray[np.bool_]:
    """(N,) whether the racket has touched each ball."""
    touched: NDArray[np.bool_] = records["count"] > 0
    return touched


def settled_balls(records: NDArray[Any]) -> NDArray[np.bool_]:
    """(N,) whether each ball has landed, or touched net or floor."""
    settled: NDArray[np.bool_] = (
        (records["landing_iteration"] >= 0)
        | (records["net_count"] > 0)
        | (records["floor_count"] > 0)
    )
    return settled
