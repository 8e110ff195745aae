"""Fits a flight model to recorded positions, one flight between each two bounces.

Each flight has drag and Magnus force: start position, start velocity, drag and turn (Magnus
acceleration over speed) are found by damped least squares with weak priors of drag and turn.
Outliers count less (Huber weights). The flights before and after a bounce meet in its point; both
are fitted again through that point, so that the path has no
jump.
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
"""Prior standard deviation of each number of the turn [1/s]; a strong top spin has 0.3."""
UNKNOWN_TURN = np.zeros(3)
DRAG_BELIEF = 0.25
"""Prior standard deviation of the drag, as a share of the model's drag."""
ANCHOR_NOISE = 1e-5
"""Tolerance of the common point of the two flights at a bounce [m]."""
FAR = 2.5
"""Rows at more than this multiple of the median distance count less."""
DEEP = 0.02
"""Least rise of the ball after the lowest row of a bounce [m]."""
FEWEST = 4
"""Least number of rows to fit a flight."""
SLOPE_SHARE = 1e-3
"""Step of the numeric derivatives, as a share of an unknown's scale."""
CLOSE_ENOUGH = 1e-3
"""Precision of a fit, see `fitted`."""
MAX_ROUNDS = 12
SCALES = np.array([0.01] * 3 + [0.1] * 3 + [0.1 * AERODYNAMICS.drag] + [0.1] * 3)
"""Typical sizes of the ten unknowns, for differences and damping."""
BELIEFS = np.array([0.0] * 6 + [1 / (DRAG_BELIEF * AERODYNAMICS.drag)] + [1 / TURN_BELIEF] * 3)
"""Prior certainty of each unknown [1 / unit of the unknown]."""
Fly = Callable[[FloatArray], FloatArray]
"""Maps unknowns (K, B) of B flights to positions (T, 3, B)."""
_TURNING = replace(AERODYNAMICS, spin_decay=0.0, lift_saturation=0.0).air


@dataclass(frozen=True, eq=False)
class Flight:
    """Flight without a bounce: state at `origin`, drag and turn."""

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
    """Time of the first row [s]."""
    end: float
    """Time of the last fitted row [s]."""
    residuals: FloatArray
    """(N,) distance of each fitted row from the fit [m]"""

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
        """Spins (T, 3) [rad/s] at `times` (T,) [s], for a ball with `velocities` (T, 3) [m/s].

        Before the first bounce, a simulated ball with these spins turns like the fitted one.
        After a bounce, the law of the bounce gives the spin, which is then so large that the
        turn of the flight determines it badly.
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
    """Fits flights and bounces to `positions` (N, 3) [m] at rising `stamps` (N,) [s].

    Too few rows before the first or after the last bounce are left out: the fit then starts
    later or ends earlier.
    """
    first, last, bounces = _covered(positions)
    edges = [first - 1, *bounces, last + 1]
    flights = [fit_segment(stamps[a + 1 : b], positions[a + 1 : b]) for a, b in pairwise(edges)]

    # intersection of two flights => common point of both
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
    """Prior turn (3,) of each flight: unknown, or derived from the last bounce."""
    turns = [np.zeros(3)]
    spin: FloatArray | None = None
    for before, after, time in zip(flights, flights[1:], bounce_times, strict=False):
        spin = spin_after(before.at(np.array([time]))[1], before.turn, spin)
        speed = float(np.linalg.norm(after.at(np.array([time]))[1]))
        turns.append(AERODYNAMICS.turn(spin, speed))
    return turns


def bounce_rows(positions: FloatArray) -> tuple[list[int], int]:
    """Finds the lowest rows of `positions` (N, 3) at bounces, and the last certain row in flight.

    Only the lowest row of a bounce may be on either side of it. Final rows that rise a little
    after a lowest one belong to an incomplete bounce: the last certain row precedes them.
    """
    raw = positions[:, 2]
    # a single outlier is not a bounce
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
    """Returns the first and last row to fit, and the bounce rows between them."""
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
    """Finds the time [s] and point (3,) [m] of equal height of two flights, between two times."""
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
    """Fits a flight without a bounce to `positions` (n, 3) at `stamps` (n,).

    `anchors`: times and points of the flight to be met exactly. `start`: first guess.
    `expected_turn` (3,) [1/s]: prior of the turn.
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
    """Fits the unknowns (K,) of a flight to `points` (n, 3), from a first guess.

    The flight meets the last `anchors` points exactly. Scales, centre, certainty (`beliefs`) and
    limit of each unknown are (K,); limited unknowns change by at most their scale in a step. The
    search ends when no unknown changes by more than `precision`, a share of its scale.
    """
    rows = len(points) - anchors
    noise = np.full(len(points), POSITION_NOISE)
    noise[rows:] = ANCHOR_NOISE
    largest = np.asarray(largest)
    largest_step = np.where(np.isinf(largest), np.inf, 1.0)
    for _ in range(MAX_ROUNDS):
        flown, slopes = sloped(fly, unknowns, scales)
        misses = points - flown

        # outliers count less
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
    """Computes positions (T, 3) of a flight, and their derivatives (T, 3, K) by unknowns (K,)."""
    # the flight itself, and others with one changed unknown
    change = SLOPE_SHARE * scales
    flown = fly(unknowns[:, None] + np.column_stack([np.zeros(len(change)), np.diag(change)]))
    return flown[..., 0], (flown[..., 1:] - flown[..., :1]) / change


def _guess(times: FloatArray, positions: FloatArray) -> FloatArray:
    """Guesses the unknowns from a parabola through the positions."""
    degree = min(2, len(times) - 1)
    coefficients = np.zeros((3, 3))
    coefficients[: degree + 1] = np.polynomial.polynomial.polyfit(times, positions, degree)
    return np.concatenate([coefficients[0], coefficients[1], [AERODYNAMICS.drag], np.zeros(3)])


def fly(unknowns: FloatArray, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Positions and velocities (T, 3, B) of B flights, `unknowns` (10, B), at `times` (T,)."""
    # a spin without saturation and decay gives a constant turn
    balls = np.ascontiguousarray(np.vstack([unknowns[:6], unknowns[7:] / AERODYNAMICS.magnus]).T)
    forth, back = max(1, int(np.ceil(times.max() / STEP))), int(np.ceil(-times.min() / STEP))
    drags = np.ascontiguousarray(unknowns[6])
    forward = path(balls, STEP, forth, _TURNING, drags)
    backward = path(balls, -STEP, max(0, back), _TURNING, drags)
    nodes = np.concatenate([backward[:0:-1], forward])[..., :6].swapaxes(1, 2)
    node_times = STEP * np.arange(1 - len(backward), len(forward), dtype=np.float64)
    return along_path(times, nodes, node_times)
