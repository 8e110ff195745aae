"""A suite of checks for a robot, as one function for your tests.


def test_my_arm() -> None:
    check_robot("build/my_arm.so", {"gain": 2.0})
"""

import contextlib
import math
import random
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

import o80.robots.robot as robots
from o80.base.errors import InvalidArgument
from o80.replaying.conditions import reads_the_world
from o80.replaying.replay import replay
from o80.rows.columns import columns_of
from o80.rows.history import History, values_of

if TYPE_CHECKING:
    from o80.frontend.frontend import Frontend

_ITERATIONS = 40  # of a script
_COPIES = 3
_TURNS = 3
_WAIT = 60.0  # [s] for the first rows of a process


def check_robot(
    robot: Any,
    options: Mapping[str, Any] | None = None,
    *,
    seed: int = 0,
    stops_within: float = 10.0,
) -> list[str]:
    """Checks that a simulated robot keeps what o80 builds on, and raises AssertionError if not.

    1. It begins inside its limits; it moves without a halt, and all its numbers stay finite.
    2. A run is repeated by a replay, bit for bit.
    3. A reset with the same seed gives the same motion, whatever was before.
    4. A restored snapshot holds the whole state: the same commands give the same rows.
    5. Copies in a group do what single ones do.
    6. As a process of its own it stops in order, and soon.

    The robot is moved at random inside its limits; numbers without a minimum and a maximum stay
    where they begin. So only a robot that says that it is simulated is started.

    robot: name, library, file or class, as for `o80.robots.load`.
    options: of the robot.
    seed: of the random commands.
    stops_within: seconds that a stop may take.

    Returns what was not checked, a sentence each: for example that it serves no reset. Raises
    AssertionError, which says what was found; BackendHalted and DriverError if the robot halts or
    fails when it is moved; InvalidArgument.
    """
    return _Suite(robot, dict(options or {}), seed, stops_within).run()


class _Suite:
    """The checks of one robot."""

    def __init__(self, robot: Any, options: dict[str, Any], seed: int, stops_within: float) -> None:
        self._robot = robots.load(robot)
        self._options = options
        self._seed = seed
        self._stops_within = stops_within
        self._served: set[str] = set()
        self._left: list[str] = []

    def run(self) -> list[str]:
        schema = self._robot.describe(**self._options)
        if why := reads_the_world(schema):
            raise InvalidArgument(
                f"check_robot moves a robot at random, so it does not start '{schema['robot']}': "
                f"{why}"
            )
        self._served = {request["name"] for request in schema["requests"]}
        with self._inline() as arm:
            self._begins_and_moves(arm)
        self._needs(("snapshot", "restore"), self._replays, "a replay")
        self._needs(("reset",), self._resets_by_its_seed, "seeds of resets")
        self._needs(("snapshot", "restore"), self._keeps_all_in_a_snapshot, "snapshots")
        self._copies_equal_single_ones()
        self._stops()
        return self._left

    def _inline(self, **more: Any) -> Any:
        return self._robot.inline(**more, **self._options)

    def _needs(self, requests: Sequence[str], check: Callable[[], None], what: str) -> None:
        if lacking := [name for name in requests if name not in self._served]:
            self._left.append(f"{what}: the robot does not serve {' and '.join(lacking)}")
        else:
            check()

    # ------------------------------------------------------------------ the checks

    def _begins_and_moves(self, arm: "Frontend") -> None:
        first = arm.history(since=0, until=0)
        values = {each.name: values_of(first, each)[0] for each in columns_of(arm.schema)}
        bounded = 0
        for actuator in arm.actuators:
            for number in actuator.numbers:
                dot = f".{number.name}" if number.name else ""
                value = float(values[f"observed.{actuator.name}{dot}"])
                low, high = number.limits.minimum, number.limits.maximum
                bounded += math.isfinite(low) and math.isfinite(high)
                assert low <= value <= high, (
                    f"observed.{actuator.name}{dot} is {value:g} in row 0, outside its limits from "
                    f"{low:g} to {high:g}"
                )
        if arm.actuators and not bounded:
            self._left.append("motion: no number has a minimum and a maximum")
        _Actions(arm, self._seed).play()
        rows = arm.history(since=0)
        for column in columns_of(arm.schema):
            if column.origin == "absent":
                continue
            at = np.flatnonzero(~np.isfinite(values_of(rows, column)))
            assert not len(at), f"{column.name} is NaN or infinite in row {rows.iteration[at[0]]}"

    def _replays(self) -> None:
        with self._inline() as arm:
            act = _Actions(arm, self._seed)
            for _ in range(3):
                act.play()
            if "reset" in self._served:
                arm.request("reset", **self._fields(arm, "reset", 1))
                act.play()
            report = replay(arm)
            assert report.identical, f"a run is not repeated by its replay: {report}"

    def _resets_by_its_seed(self) -> None:
        with self._inline() as arm:
            self._repeats(arm, "reset", 7, "after two resets with the same seed")

    def _keeps_all_in_a_snapshot(self) -> None:
        with self._inline() as arm:
            _Actions(arm, self._seed).play()
            arm.request("snapshot", **self._fields(arm, "snapshot", 0))
            self._repeats(arm, "restore", 0, "after the same snapshot was restored twice")

    def _repeats(self, arm: "Frontend", request: str, value: int, when: str) -> None:
        """Compares the motions after a request that determines the state."""
        found = []
        for turn in range(_TURNS):
            _Actions(arm, self._seed + 1 + turn).play()  # another past for each
            arm.request(request, **self._fields(arm, request, value))
            found.append(self._motion(arm))
        for other in found[1:]:
            _compare(found[0], other, when)

    def _motion(self, arm: "Frontend") -> History:
        """Rows of a script that is the same in each call."""
        begin = arm.published
        _Actions(arm, self._seed + 100).play()
        return arm.history(since=begin)

    def _copies_equal_single_ones(self) -> None:
        with contextlib.ExitStack() as stack:
            singles = [stack.enter_context(self._inline()) for _ in range(_COPIES)]
            group = stack.enter_context(self._inline(copies=_COPIES))
            for turn, single in enumerate(singles):
                for one in (single, group[turn]):
                    act = _Actions(one, self._seed + turn)
                    act.play(10)
                _compare(
                    single.history(8),
                    group[turn].history(8),
                    f"in copy {turn} of a group and in a single robot",
                )

    def _stops(self) -> None:
        process = self._robot.start(**self._options)
        try:
            with process.frontend() as arm:
                arm.wait_for(arm.published + 2, timeout=_WAIT)
            begin = time.monotonic()
        finally:
            process.stop()
        took = time.monotonic() - begin
        assert took < self._stops_within, (
            f"its process took {took:.1f} s to stop: no verb of the driver may wait so long"
        )

    @staticmethod
    def _fields(arm: "Frontend", request: str, value: int) -> dict[str, Any]:
        """Values for the seed or slot of a request, as far as it has one."""
        (described,) = (each for each in arm.schema["requests"] if each["name"] == request)
        fields = {field["name"] for field in (described.get("type") or {}).get("fields", ())}
        return {name: value for name in ("seed", "slot") if name in fields}


class _Actions:
    """Random commands inside the limits of a robot, the same for the same seed."""

    def __init__(self, arm: "Frontend", seed: int) -> None:
        self._arm = arm
        self._random = random.Random(seed)
        self._targets = [*_bounded(arm)]

    def play(self, iterations: int = _ITERATIONS) -> None:
        """Bursts so many iterations, with commands in between."""
        while iterations > 0:
            for actuator, target in self._choose():
                self._arm.add_command(
                    actuator,
                    target,
                    iterations=self._random.randrange(1, 12),
                    mode=self._random.choice(["queue", "overwrite"]),
                )
            count = min(iterations, self._random.randrange(1, 6))
            self._arm.burst(count)
            iterations -= count

    def _choose(self) -> Iterator[tuple[int, Any]]:
        for actuator, ranges in self._targets:
            if self._random.random() > 0.3:
                continue
            drawn = {name: self._draw(low, high) for name, (low, high) in ranges.items()}
            yield actuator, drawn.get("", drawn)

    def _draw(self, low: float, high: float) -> float:
        value = low + self._random.random() * (high - low)
        whole = float(round(value))  # for integers
        return whole if low <= whole <= high and high - low > 10 else value


def _bounded(arm: "Frontend") -> Iterator[tuple[int, dict[str, tuple[float, float]]]]:
    """Index of each actuator, and the ranges of its numbers with a minimum and a maximum."""
    for actuator in arm.actuators:
        ranges = {
            number.name: (number.limits.minimum, number.limits.maximum)
            for number in actuator.numbers
            if math.isfinite(number.limits.minimum)
            and math.isfinite(number.limits.maximum)
            and number.name.isidentifier() | (number.name == "")
        }
        if ranges:
            yield actuator.index, ranges


def _compare(one: History, other: History, when: str) -> None:
    """Raises AssertionError with the first number that differs in the two, row by row."""
    assert len(one) == len(other), f"{len(one)} and {len(other)} rows {when}"
    found = []
    for column in columns_of(one.schema):
        if column.origin != "robot":
            continue
        a, b = values_of(one, column), values_of(other, column)
        differs = np.flatnonzero((a != b) & ~((a != a) & (b != b)))
        if len(differs):
            row = int(differs[0])
            found.append((row, column.name, a[row].item(), b[row].item()))
    if found:
        row, name, a, b = min(found)
        raise AssertionError(f"{name} is {a!r} and {b!r} {when}, {row} rows later")
