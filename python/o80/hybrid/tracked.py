"""Reads a real world, such as a tracker, in place of a simulation."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.base.errors import InvalidArgument
from o80.frontend.frontend import Frontend
from o80.hybrid.mirror import Mirror, Motion, Pair, numbers_at
from o80.hybrid.plan import Plan
from o80.hybrid.sides import Side
from o80.hybrid.worlds import TIMEOUT, Counts


class Tracked:
    """Selects for each row of a robot the newest row of a tracker that is not later."""

    def __init__(self, tracker: Frontend, robot: Frontend, plan: Plan, max_late: int) -> None:
        """max_late: rows of the robot by which the tracker's newest row may be older."""
        clocks = robot.schema["clock"], tracker.schema["clock"]
        if clocks[0] != clocks[1] or tracker.bursting:
            raise InvalidArgument(
                f"world '{tracker.segment}' must run in real time by the clock of robot "
                f"'{robot.segment}' ({clocks[0]}), it has {clocks[1]}"
            )
        self.member, self.stalled, self.counts = tracker, "", Counts()
        self._oldest = max_late * robot.period
        rows = np.zeros((1, 1, plan.iterations), tracker.history(1).rows.dtype)
        self.side = Side(tracker, rows, plan.rig.worlds, simulated=False)
        mirror = plan.rig.mirror
        numbers = numbers_at(mirror.position, "position", robot.schema)
        pairs = [Pair(column.name, column, None, None) for column in numbers]
        plain = Mirror(mirror.position, fresh=mirror.fresh)
        self.motion = Motion(plain, pairs, 1, robot.schema)

    def reset(self, copies: NDArray[np.intp], _seeds: Sequence[int], robot: Side) -> None:
        """Begins an episode at the robot's newest row. Raises BackendGone for a dead tracker."""
        self.member.wait_for(self.member.published + 1, timeout=TIMEOUT)
        if self.motion.tracks:
            self.motion.begin(copies, robot.newest(copies))

    def feed(self, _rows: NDArray[Any]) -> None:
        """Does nothing: `follow` gets all rows."""

    def see_newest(self) -> None:
        """Does nothing: the newest row is that of the last step."""

    def mirror(self, _copies: NDArray[np.intp], robot: Side, _seen: object = None) -> None:
        """Selects the world's row that belongs to the robot's newest row."""
        self.side.rows[...] = self._beside(robot.last)[-1]

    def follow(
        self, copies: NDArray[np.intp], rows: NDArray[Any], period: float, _seen: object = None
    ) -> None:
        """Selects the world's rows that belong to the robot's rows of a step."""
        self.counts.steps += 1
        self.counts.play += rows.size * period
        self.motion.follow(copies, rows, period)
        self.counts.missed = self.motion.all_missed
        self.side.rows[0, 0] = self._beside(rows[0])

    def _beside(self, rows: NDArray[Any]) -> NDArray[Any]:
        tracker = self.member
        first, last = int(rows["time"][0]), int(rows["time"][-1])
        found = tracker.history(from_time=first - int(self._oldest * 1e9)).rows
        found = found if len(found) else tracker.history(1).rows
        places = np.searchsorted(found["time"], rows["time"], side="right") - 1
        age = (last - int(found["time"][max(places[-1], 0)])) * 1e-9
        self.stalled = ""
        if age > self._oldest:
            self.stalled = (
                f"the newest row of world '{tracker.segment}' is {age:.3g} s old, more than "
                f"{self._oldest:.3g} s (max_late)"
            )
        return found[np.maximum(places, 0)]
