"""Balls of a twin: their options, and their published records.

Only this module uses the simulator's names of contacts.
"""

from __future__ import annotations

from collections.abc import Mapping
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

FAR = 1e9
"""Bound that no ball reaches [m]."""
SURFACES = {
    "racket": RACKET_RESTITUTION,
    "table": TABLE_RESTITUTION,
    "net": NET_RESTITUTION,
    "floor": FLOOR_RESTITUTION,
}
"""Restitutions of surfaces by the names of geoms."""


def ball_options() -> dict[str, Any]:
    """Returns the simulator's options of ball, air and surfaces."""
    return {
        "balls": "ball",
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
    """Returns the fields of the request `fly_out`: the first ball flies until it has bounced off
    table, net or floor, or has passed y [m], both checked every `every` iterations.
    """
    return {"every": every, "low": (-FAR, passed_y, -FAR)}


FLAGS = {
    "touched": ("racket", "count", ">", 0),
    "landed": ("table", "iteration", ">=", 0),
    "met_net": ("net", "count", ">", 0),
    "touched_floor": ("floor", "count", ">", 0),
}
"""Flags of a ball: surface, field of its record, comparison and number.

`iteration`: of the first contact after the racket's, or -1.
"""
COMPARE = {">": np.greater, ">=": np.greater_equal}


def event_flags() -> dict[str, Any]:
    """Returns the flags of the first ball of each row, for `InlineGroup.gather`."""
    return {
        name: (f"extended.contacts[0].{surface}.{number}", compare, value)
        for name, (surface, number, compare, value) in FLAGS.items()
    }


class BallRecords:
    """Records of N balls, views of an array (N,) that each step overwrites."""

    def __init__(
        self, records: NDArray[Any], flags: Mapping[str, NDArray[np.bool_]] | None = None
    ) -> None:
        """flags: of `event_flags`, overwritten in each step, too; None: `read` computes them."""
        self._compared: list[Any] = []
        if flags is None:
            flags = {name: np.zeros(len(records), np.bool_) for name in FLAGS}
            for name, (surface, number, compare, value) in FLAGS.items():
                each = COMPARE[compare], records[surface][number], value, flags[name]
                self._compared.append(each)
        racket, table, net = records["racket"], records["table"], records["net"]
        self._landed_at, self._net_at = table["iteration"], net["iteration"]
        self._landed, self._met_net = flags["landed"], flags["met_net"]
        self._all_false = np.zeros(len(records), np.bool_)
        self._all_false.flags.writeable = False
        self._record = BallRecord(
            racket["smallest_distance"],
            flags["touched"],
            racket["velocity_after"],
            racket["largest_speed"],
            flags["landed"],
            table["position"],
            self._all_false,
            flags["touched_floor"],
            net["position"],
            records["floor"]["position"],
        )

    def read(self) -> BallRecord:
        """Reads the records; all arrays but `touched_net` are views."""
        record = self._record
        for compare, numbers, value, flag in self._compared:
            compare(numbers, value, out=flag)
        if np.count_nonzero(self._met_net):
            late = self._landed & (self._landed_at < self._net_at)
            record.touched_net = self._met_net & ~late
        else:
            record.touched_net = self._all_false
        return record
