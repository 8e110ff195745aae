"""Selects the numbers of a robot's rows that the joints of a world mirror."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.base.argument_checks import whole
from o80.base.arrays import FloatArray
from o80.base.errors import InvalidArgument
from o80.base.loop_options import did_you_mean
from o80.rows.columns import Column, columns_at
from o80.rows.layout import joined


@dataclass(frozen=True)
class difference:  # noqa: N801, it reads as a function where a mirror is written
    """Computes the velocity: the difference of positions over `rows` rows, divided by their time.

    Restarts at each reset and after each missed row. More rows reduce noise and add delay.
    """

    rows: int = 3

    def __post_init__(self) -> None:
        whole(self.rows, "rows of difference", 1)


@dataclass(frozen=True)
class Mirror:
    """Selects the numbers of a robot's rows that the joints of a world mirror."""

    position: str = "observed"
    """Path of the positions in a row, in the order of the robot's actuators."""
    velocity: str | difference | None = None
    """Path of their velocities, or `difference(rows=3)`. Needed for a world whose joints have
    velocities: with velocity 0 a moving arm would hit things like a fixed one. The velocity of a
    number that is spread over a joint's range is a difference, unless its unit is 1/s."""
    names: Mapping[str, str | None] | Sequence[str] = field(default_factory=dict)
    """The world's joint for each actuator whose name differs (None: it is not mirrored); or the
    joints of all numbers at `position`, in order."""
    fresh: str | None = None
    """Path of a boolean that is false in a row without a new reading: the world then holds the
    last position, at velocity 0."""


@dataclass(frozen=True)
class Pair:
    """A number of the robot, and the joint of the world that mirrors it."""

    joint: str
    position: Column
    velocity: Column | None
    """None: the difference of positions is used."""
    over: tuple[float, float] | None
    """The numbers at both ends of the joint's range, if the number is spread over this range."""


def pairs_of(
    mirror: Mirror, robot: Mapping[str, Any], joints: Mapping[str, str], world: str
) -> list[Pair]:
    """Pairs numbers with joints. Raises InvalidArgument, with both names, if they do not match.

    robot: schema of the robot. joints: the joints of the world, with their units.
    """
    name = robot["robot"]
    positions = numbers_at(mirror.position, "position", robot)
    velocities: list[Column] | list[None] = [None] * len(positions)
    if isinstance(mirror.velocity, str):
        velocities = numbers_at(mirror.velocity, "velocity", robot)
        if len(velocities) != len(positions):
            raise InvalidArgument(
                f"mirror: '{mirror.velocity}' of robot '{name}' has {len(velocities)} numbers, "
                f"'{mirror.position}' has {len(positions)}"
            )
    named = _joints_of(mirror, [actuator["name"] for actuator in robot["actuators"]], positions)
    found = []
    for i, (joint, column) in enumerate(zip(named, positions, strict=True)):
        if joint is None:
            continue
        if joint not in joints:
            near = did_you_mean(joint, [*joints])
            raise InvalidArgument(
                f"mirror: '{column.name}' of robot '{name}' has no joint '{joint}' in world "
                f"'{world}'{near or '. It has ' + (', '.join(joints) or 'none')}: name the joint "
                f"in Mirror(names=...)"
            )
        over = _spread(column, i, robot, joints[joint], f"joint '{joint}' of world '{world}'")
        velocity = velocities[i]
        if over is not None and velocity is not None and velocity.unit != "1/s":
            velocity = None  # it is that of the joint, and not of the number
        found.append(Pair(joint, column, velocity, over))
    if not found:
        raise InvalidArgument(f"mirror: no joint of world '{world}' follows robot '{name}'")
    return found


def numbers_at(path: str, what: str, robot: Mapping[str, Any]) -> list[Column]:
    """Returns the numbers at a path; if states have several, those named `what`."""
    columns = columns_at(robot, path)
    if path.partition(".")[0] == "extended":
        return columns
    states = [column for column in columns if column.name.count(".") > 1]
    chosen = [column for column in states if column.name.rpartition(".")[2] == what]
    return chosen if states else columns


def _joints_of(
    mirror: Mirror, actuators: Sequence[str], positions: Sequence[Column]
) -> Sequence[str | None]:
    names = mirror.names
    if not isinstance(names, Mapping):
        if len(names) != len(positions):
            raise InvalidArgument(
                f"mirror: names has {len(names)} joints for {len(positions)} numbers at "
                f"'{mirror.position}'"
            )
        return names
    own = [column.name.split(".") for column in positions]
    if all(parts[0] == "observed" for parts in own):
        of = [parts[1] for parts in own]
    elif len(positions) == len(actuators):
        of = [*actuators]
    else:
        raise InvalidArgument(
            f"mirror: '{mirror.position}' has {len(positions)} numbers and the robot "
            f"{len(actuators)} actuators: name the joint of each number, "
            f"Mirror(names=[...])"
        )
    for name in names:
        if name not in of:
            near = did_you_mean(name, of)
            raise InvalidArgument(f"mirror: names has no actuator '{name}'{near}")
    return [names.get(name, name) for name in of]


def _spread(
    column: Column, index: int, robot: Mapping[str, Any], unit: str, joint: str
) -> tuple[float, float] | None:
    """Returns limits to spread over a joint's range. Raises InvalidArgument for other units."""
    if column.unit == unit or not column.unit or unit in ("", "rad or m"):
        return None
    limits = robot["actuators"][index]["limits"][0] if index < len(robot["actuators"]) else {}
    low, high = limits.get("minimum"), limits.get("maximum")
    if column.unit == "1" and low is not None and high is not None:
        return low, high
    raise InvalidArgument(
        f"mirror: '{column.name}' of robot '{robot['robot']}' is in {column.unit}, {joint} in "
        f"{unit}: only a number with the unit 1 and limits is spread over a joint's range"
    )


class Reader:
    """Reads the numbers (..., numbers) of columns from rows (...), in double precision."""

    def __init__(self, columns: Sequence[Column]) -> None:
        runs = joined((column.dtype, column.offset, 1) for column in columns)
        self._parts = [(np.dtype((kind, (count,))), offset) for kind, offset, count in runs]

    def __call__(self, rows: NDArray[Any]) -> FloatArray:
        parts = [rows.getfield(dtype, offset) for dtype, offset in self._parts]
        if not parts:
            return np.zeros((*rows.shape, 0))
        return np.concatenate(parts, axis=-1, dtype=np.float64, casting="unsafe")


class Motion:
    """Tracks positions and velocities of the mirrored numbers of n robots, from row to row."""

    def __init__(self, mirror: Mirror, pairs: Sequence[Pair], copies: int, schema: Any) -> None:
        self._positions = Reader([pair.position for pair in pairs])
        self._velocities = Reader([pair.velocity for pair in pairs if pair.velocity is not None])
        self._joints = len(pairs)
        self._named = [i for i, pair in enumerate(pairs) if pair.velocity is not None]
        self._fresh = None if mirror.fresh is None else columns_at(schema, mirror.fresh)[0]
        self._has_velocity = mirror.velocity is not None
        self._over = 0  # rows of a difference; 0: all velocities are read
        if self._has_velocity and len(self._named) < len(pairs):
            self._over = mirror.velocity.rows if isinstance(mirror.velocity, difference) else 3
        self.tracks = bool(self._over or self._fresh)
        """Whether a row depends on rows before."""
        self.paths: dict[str, str] | None = None
        """Paths in a row of numbers that are mirrored unchanged; None if some are computed."""
        dropped = isinstance(mirror.names, Mapping) and None in mirror.names.values()
        if not (self._over or self._fresh or dropped):
            self.paths = {"position": mirror.position}
            if isinstance(mirror.velocity, str):
                self.paths["velocity"] = mirror.velocity
        self._past: FloatArray = np.zeros((copies, self._over + 1, len(pairs)))
        self._good: NDArray[np.int64] = np.ones(copies, np.int64)  # consecutive rows with a reading
        self.missed: NDArray[np.int64] = np.zeros(copies, np.int64)
        """(copies,) consecutive rows without a new reading."""
        self.all_missed = 0
        """Number of rows of all copies without a new reading."""

    def begin(self, copies: NDArray[np.intp], rows: NDArray[Any]) -> None:
        """Begins episodes of these copies at these rows (n,). Not needed unless it `tracks`."""
        self.missed[copies], self._good[copies] = 0, 1
        self._past[copies, -1] = self._positions(rows)

    def standing(self, rows: NDArray[Any]) -> tuple[FloatArray, FloatArray | None]:
        """Returns positions and velocities (n, 1, joints) of rows (n,) before an episode."""
        positions = self._positions(rows)[:, np.newaxis]
        return positions, self._read_velocities(rows)[:, np.newaxis] if self._has_velocity else None

    def _read_velocities(self, rows: NDArray[Any]) -> FloatArray:
        """Reads velocities (..., joints) from rows (...): 0 where they are differences."""
        found = self._velocities(rows)
        if len(self._named) == self._joints:
            return found
        velocities = np.zeros((*rows.shape, self._joints))
        velocities[..., self._named] = found
        return velocities

    def follow(
        self, copies: NDArray[np.intp], rows: NDArray[Any], period: float
    ) -> tuple[FloatArray, FloatArray | None]:
        """Returns positions and velocities (n, iterations, joints) of rows (n, iterations)."""
        positions = self._positions(rows)
        velocities = self._read_velocities(rows) if self._has_velocity else None
        fresh = None
        if self._fresh is not None:
            fresh = rows.getfield(self._fresh.dtype, self._fresh.offset).astype(bool)
        if not self.tracks:
            return positions, velocities
        for i in range(positions.shape[1]):
            self._follow_row(copies, positions[:, i], velocities, i, fresh, period)
        return positions, velocities

    def _follow_row(
        self,
        copies: NDArray[np.intp],
        position: FloatArray,
        velocities: FloatArray | None,
        i: int,
        fresh: NDArray[np.bool_] | None,
        period: float,
    ) -> None:
        missed = self.missed[copies]
        lost = np.zeros(len(copies), np.bool_) if fresh is None else ~fresh[:, i]
        past = self._past[copies]
        position[lost] = past[lost, -1]
        past = np.concatenate([past[:, 1:], position[:, None]], axis=1)
        good = np.where(lost, 0, self._good[copies] + 1)
        if velocities is not None:
            if self._over:
                span = np.clip(good - 1, 1, self._over)
                before = past[np.arange(len(copies)), self._over - span]
                # the first reading after missed rows covers all rows since the last reading
                span = np.where(good == 1, missed + 1, span)
                found = (position - before) / (span * period)[:, None]
                found[:, self._named] = velocities[:, i, self._named]
                velocities[:, i] = found
            velocities[lost, i] = 0.0
        self._past[copies], self._good[copies] = past, good
        self.missed[copies] = np.where(lost, missed + 1, 0)
        self.all_missed += int(np.count_nonzero(lost))
