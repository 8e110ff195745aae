"""The flight that explains recorded positions: a flight model between bounces, fitted to them.

Each segment between two bounces is a flight with drag and Magnus force: start position, start
velocity, drag and turn (Magnus acceleration over speed) are found by damped least squares with
weak beliefs about drag and turn, and with far rows counting less (Huber weights). A bounce is
where the flights before and after it meet; both are then fitted again through that one point, so
that the path has no jump.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from o80.base.arrays import FloatArray
from o80_mujoco.balls import path

from ..physics.aerodynamics import AERODYNAMICS
from ..physics.impact import spin_after
from ..physics.interpolation import along_path

STEP = 0.05
"""Step of the integration [s]; the error stays below 1 um."""
POSITION_NOISE = 0.003
"""Expected error of a recorded position [m]."""
TURN_BELIEF = 0.3
"""Standard deviation expected of each number of the turn [1/s]: a strong top spin has 0.3."""
UNKNOWN_TURN = np.zeros(3)
DRAG_BELIEF = 0.25
"""Standard deviation expected of the drag, as a share of the drag of the model."""
ANCHOR_NOISE = 1e-5
"""How closely the two flights of a bounce meet in its point [m]."""
FAR = 2.5
"""Rows further from the flight than this many times the usual distance count less."""
DEEP = 0.02
"""A bounce is a lowest row from which the ball rises by more than this [m]."""
FEWEST = 4
"""Rows needed to fit the flight between two bounces."""
SLOPE_SHARE = 1e-3
"""Change of an unknown for a difference, as a share of its scale."""
CLOSE_ENOUGH = 1e-3
"""Precision of a fit, see `fitted`."""
MAX_ROUNDS = 12
SCALES = np.array([0.01] * 3 + [0.1] * 3 + [0.1 * AERODYNAMICS.drag] + [0.1] * 3)
"""Typical sizes of the ten unknowns, for differences and damping."""
BELIEFS = np.array([0.0] * 6 + [1 / (DRAG_BELIEF * AERODYNAMICS.drag)] + [1 / TURN_BELIEF] * 3)
"""How sure each unknown is known before [1 / its unit]."""
Fly = Callable[[FloatArray], FloatArray]
"""Positions (T, 3, B) of B flights of unknowns (K, B)."""
_TURNING = replace(AERODYNAMICS, spin_decay=0.0, lift_saturation=0.0).air


@dataclass(frozen=True, eq=False)
class Flight:
    """A flight without bounce: a state at `origin`, drag and turn."""

    origin: float
    """[s]"""
    unknowns: FloatArray
    """(10,) position [m], velocity [m/s], drag [1/m], turn (3) [1/s]"""

    @property
    def turn(self) -> FloatArray:
        """(3,) Magnus acceleration = turn x velocity [1/s]."""
        return self.unknowns[7:]

    def at(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Positions [m] and velocities [m/s], each (T, 3), at `times` (T,) [s]."""
        positions, velocities = fly(self.unknowns[:, None], times - self.origin)
        return positions[..., 0], velocities[..., 0]


@dataclass(frozen=True, eq=False)
class FlightFit:
    """Result of a fit: successive flights, joined at bounces."""

    flights: tuple[Flight, ...]
    bounce_times: FloatArray
    """(flights - 1,) [s]"""
    start: float
    """First row [s]."""
    end: float
    """Last row that the fit covers [s]."""
    residuals: FloatArray
    """(N,) distance of each row from the fit [m]; NaN-free, rows after `end` are left out"""

    def at(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Positions [m] and velocities [m/s], each (T, 3), at `times` (T,) [s]."""
        positions, velocities = np.empty((len(times), 3)), np.empty((len(times), 3))
        which = np.searchsorted(self.bounce_times, times, side="right")
        for index, flight in enumerate(self.flights):
            mine = which == index
            if mine.any():
                positions[mine], velocities[mine] = flight.at(times[mine])
        return positions, velocities

    def spins(self, times: FloatArray, velocities: FloatArray) -> FloatArray:
        """Spins (T, 3) [rad/s] at `times` (T,) [s], where the ball has `velocities` (T, 3) [m/s].

        Before the first bounce, those with which a simulated ball turns as the fitted one does.
        After a bounce, those that the law of the bounce gives: the ball then spins so much that
        the turn of its flight says little about its spin.
        """
        spins = AERODYNAMICS.spins(self.flights[0].turn, np.linalg.norm(velocities, axis=1))
        spin: FloatArray | None = None
        for index, time in enumerate(self.bounce_times):
            before = self.flights[index]
            spin = spin_after(before.at(np.array([time]))[1], before.turn, spin)
            mine = times >= time
            spins[mine] = spin * np.exp(-AERODYNAMICS.spin_decay * (times[mine] - time))[:, None]
        return spins


def fit_flight(stamps: FloatArray, positions: FloatArray) -> FlightFit:
    """The flights and bounces behind `positions` (N, 3) [m] at `stamps` (N,) [s], rising.

    A few rows before the first or after the last bounce that are too few to say anything are
    left out: the fit then starts later or ends earlier.
    """
    first, last, bounces = _covered(positions)
    edges = [first - 1, *bounces, last + 1]
    flights = [fit_segment(stamps[a + 1 : b], positions[a + 1 : b]) for a, b in pairwise(edges)]

    # where two flights meet => both go through that point
    meetings = [
        meeting(before, after, float(stamps[row - 1]), float(stamps[row + 1]))
        for before, after, row in zip(flights, flights[1:], bounces, strict=False)
    ]
    times = np.array([time for time, _ in meetings])
    turns = _expected_turns(flights, times)
    which = np.searchsorted(times, stamps, side="right")
    inside = (np.arange(len(stamps)) >= first) & (np.arange(len(stamps)) <= last)
    refined = tuple(
        fit_segment(
            stamps[(which == index) & inside],
            positions[(which == index) & inside],
            anchors=meetings[max(0, index - 1) : index + 1],
            start=flight,
            expected_turn=turns[index],
        )
        for index, flight in enumerate(flights)
    )
    fit = FlightFit(
        flights=refined,
        bounce_times=times,
        start=float(stamps[first]),
        end=float(stamps[last]),
        residuals=np.zeros(0),
    )
    fitted, _ = fit.at(stamps[inside])
    return replace(fit, residuals=np.linalg.norm(fitted - positions[inside], axis=1))


def _expected_turns(flights: Sequence[Flight], bounce_times: FloatArray) -> list[FloatArray]:
    """The turn (3,) of each flight before it is fitted: unknown, or what the last bounce gives."""
    turns = [np.zeros(3)]
    spin: FloatArray | None = None
    for before, after, time in zip(flights, flights[1:], bounce_times, strict=False):
        spin = spin_after(before.at(np.array([time]))[1], before.turn, spin)
        speed = float(np.linalg.norm(after.at(np.array([time]))[1]))
        turns.append(AERODYNAMICS.turn(spin, speed))
    return turns


def bounce_rows(positions: FloatArray) -> tuple[list[int], int]:
    """Lowest rows of `positions` (N, 3) at bounces, and the last row that is surely in flight.

    Only the lowest row of a bounce may lie on either side of it. Rows at the end that rise a
    little from a lowest one belong to a bounce too short to be seen: the last sure row is before.
    """
    raw = positions[:, 2]
    # a single row far off is not a bounce
    heights = np.median(sliding_window_view(np.pad(raw, 1, mode="edge"), 3), axis=-1)
    found: list[int] = []
    falling = False
    turn = 0
    for row, height in enumerate(heights):
        if (height < heights[turn]) == falling:
            turn = row
        if abs(height - heights[turn]) > DEEP:
            if falling:
                found.append(_lowest_near(raw, turn))
            falling, turn = not falling, row
    return found, _lowest_near(raw, turn) if falling else len(raw) - 1


def _lowest_near(heights: FloatArray, row: int) -> int:
    start = max(0, row - 1)
    return start + int(np.argmin(heights[start : row + 2]))


def _covered(positions: FloatArray) -> tuple[int, int, list[int]]:
    """First and last row to fit, and the bounce rows between them."""
    bounces, last = bounce_rows(positions)
    first = 0
    if bounces and bounces[0] < FEWEST:
        first = bounces.pop(0) + 1
    if bounces and last - bounces[-1] < FEWEST:
        last = bounces.pop() - 1
    return first, last, bounces


def meeting(
    before: Flight, after: Flight, earliest: float, latest: float
) -> tuple[float, FloatArray]:
    """Time [s] and point (3,) [m], between two times, where two flights have equal height."""
    times = np.linspace(earliest, latest, 257)
    falling, rising = before.at(times)[0], after.at(times)[0]
    gap = rising[:, 2] - falling[:, 2]
    time = float(np.interp(0.0, np.maximum.accumulate(gap), times))
    at = np.array([time])
    return time, (before.at(at)[0][0] + after.at(at)[0][0]) / 2


def fit_segment(
    stamps: FloatArray,
    positions: FloatArray,
    *,
    anchors: Sequence[tuple[float, FloatArray]] = (),
    start: Flight | None = None,
    expected_turn: FloatArray = UNKNOWN_TURN,
) -> Flight:
    """The flight without bounce through `positions` (n, 3) at `stamps` (n,).

    `anchors` are times and points it goes through exactly; `start` is a first guess. What the
    positions leave open is drawn towards `expected_turn` (3,) [1/s].
    """
    origin = float(stamps[0]) if start is None else start.origin
    unknowns = _guess(stamps - origin, positions) if start is None else start.unknowns
    times = np.concatenate([stamps, [time for time, _ in anchors]]) - origin
    points = np.concatenate([positions, *(point[None] for _, point in anchors)])
    centre = np.concatenate([np.zeros(6), [AERODYNAMICS.drag], expected_turn])
    unknowns = fitted(
        lambda tried: fly(tried, times)[0],
        unknowns,
        points,
        anchors=len(anchors),
        scales=SCALES,
        beliefs=BELIEFS,
        centre=centre,
        precision=CLOSE_ENOUGH,
    )
    return Flight(origin=origin, unknowns=unknowns)


def fitted(
    fly: Fly,
    unknowns: FloatArray,
    points: FloatArray,
    *,
    anchors: int,
    scales: FloatArray,
    beliefs: FloatArray,
    centre: FloatArray,
    precision: float,
    largest: FloatArray | float = np.inf,
) -> FloatArray:
    """The unknowns (K,) of the flight that goes best through `points` (n, 3), from a first guess.

    It goes through the last `anchors` points exactly. Scales, centre, certainty (`beliefs`) and
    limit of each unknown are (K,); one with a limit changes by at most its scale in a step. The
    search ends when no unknown moves by more than `precision`, a share of its scale.
    """
    rows = len(points) - anchors
    noise = np.full(len(points), POSITION_NOISE)
    noise[rows:] = ANCHOR_NOISE
    largest = np.asarray(largest)
    largest_step = np.where(np.isinf(largest), np.inf, 1.0)
    for _ in range(MAX_ROUNDS):
        flown, slopes = sloped(fly, unknowns, scales)
        misses = points - flown

        # far rows count less
        distance = np.linalg.norm(misses, axis=1) / noise
        usual = max(1.0, float(np.median(distance)))
        weight = np.sqrt(np.minimum(1.0, FAR * usual / np.maximum(distance, 1e-9)))
        weight[rows:] = 1.0
        weight /= noise

        # rows and beliefs => the step
        weighted = (weight[:, None, None] * slopes).reshape(-1, len(unknowns))
        matrix = np.vstack([weighted, np.diag(beliefs)])
        right = np.concatenate([(weight[:, None] * misses).ravel(), beliefs * (centre - unknowns)])
        step = np.linalg.lstsq(matrix * scales, right, rcond=1e-10)[0]
        step = np.clip(step, -largest_step, largest_step)
        unknowns = np.clip(unknowns + scales * step, -largest, largest)
        if np.abs(step).max() < precision:
            break
    return unknowns


def sloped(fly: Fly, unknowns: FloatArray, scales: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Positions (T, 3) of a flight, and their slopes (T, 3, K) in its unknowns (K,)."""
    # the flight as it is and others with one unknown changed
    change = SLOPE_SHARE * scales
    flown = fly(unknowns[:, None] + np.column_stack([np.zeros(len(change)), np.diag(change)]))
    return flown[..., 0], (flown[..., 1:] - flown[..., :1]) / change


def _guess(times: FloatArray, positions: FloatArray) -> FloatArray:
    """Unknowns from a parabola through the positions."""
    degree = min(2, len(times) - 1)
    coefficients = np.zeros((3, 3))
    coefficients[: degree + 1] = np.polynomial.polynomial.polyfit(times, positions, degree)
    return np.concatenate([coefficients[0], coefficients[1], [AERODYNAMICS.drag], np.zeros(3)])


def fly(unknowns: FloatArray, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Positions and velocities (T, 3, B) of B flights, `unknowns` (10, B), at `times` (T,)."""
    # a spin without saturation and decay turns the flight as its turn says
    balls = np.ascontiguousarray(np.vstack([unknowns[:6], unknowns[7:] / AERODYNAMICS.magnus]).T)
    forth, back = max(1, int(np.ceil(times.max() / STEP))), int(np.ceil(-times.min() / STEP))
    drags = np.ascontiguousarray(unknowns[6])
    forward = path(balls, STEP, forth, _TURNING, drags)
    backward = path(balls, -STEP, max(0, back), _TURNING, drags)
    nodes = np.concatenate([backward[:0:-1], forward])[..., :6].swapaxes(1, 2)
    node_times = STEP * np.arange(1 - len(backward), len(forward), dtype=np.float64)
    return along_path(times, nodes, node_times)
