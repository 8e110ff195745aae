"""Reconstructs time stamps of recordings without any, from positions and velocities.

The vision system delivers frames at a fixed rate; a reader took the newest frame about every 10 ms
and stored no stamp. Rows are therefore whole numbers of frames apart (0: the same frame again,
mostly 1 or 2, more after a lost ball). A flight fitted to roughly stamped rows is far more exact
than the stamps: a row's place on the flight determines its frame. The rough stamps come from the
reader's rate, or after a poor fit from distance over recorded velocity (which lags by some 25 ms).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from o80.base.arrays import FloatArray, IntArray

from .flight_fit import (
    BELIEFS,
    POSITION_NOISE,
    SCALES,
    Flight,
    bounce_rows,
    fit_segment,
    fly,
    meeting,
    sloped,
)

FRAME_PERIOD = 1 / 180
"""Interval of the vision system's frames [s]: slope of known stamps over frame numbers."""
READER_PERIOD = 0.010
"""Approximate interval of the reader's rows [s]."""
CLOSE = 0.0025
"""Mean distance of rows from a flight below which their frames are certain [m]."""
CLEAR_GAIN = 0.1
"""Least relative fall of the squared distances for which a frame is added or removed."""
MAX_ROUNDS = 30
NEAR_BOUNCE = 3
"""Number of rows next to a bounce whose recorded velocities are ignored."""
LONGEST_GAP = 8
"""Largest number of frames from the last row before a bounce to the first one after it."""


def new_frames(positions: FloatArray) -> NDArray[np.bool_]:
    """Returns (N,) False for rows that repeat the previous frame."""
    repeated = np.all(np.diff(positions, axis=0) == 0, axis=1)
    return np.concatenate([[True], ~repeated])


def frames_of(positions: FloatArray, velocities: FloatArray, rows: IntArray) -> IntArray:
    """Finds the frame number (N,) of each row, from 0; stamps are numbers times `FRAME_PERIOD`.

    `positions` (N, 3) [m] and `velocities` (N, 3) [m/s] hold new frames only, `rows` (N,) their
    row numbers in the file.
    """
    bounces, _ = bounce_rows(positions)
    edges = [-1, *bounces, len(positions)]
    frames = np.zeros(len(positions), dtype=np.int64)
    before: Flight | None = None
    for first, last in pairwise(edges):
        segment = slice(first + 1, last)
        counted = _count(positions[segment], velocities[segment], rows[segment])
        mine, flight = counted.frames, counted.flight
        if before is not None:
            # the segment continues the previous one; the lowest row is between them
            start = int(frames[first - 1])
            ahead, between = _gap(before, flight, start, positions[first])
            frames[first] = start + between
            mine = mine + start + ahead
            flight = replace(flight, origin=flight.origin + (start + ahead) * FRAME_PERIOD)
        frames[segment] = mine
        before = flight
    return frames


@dataclass(frozen=True, eq=False)
class _Count:
    frames: IntArray
    """(n,) frame numbers, from 0"""
    flight: Flight
    """Flight fitted to the rows at frames * `FRAME_PERIOD`."""
    distance: float
    """Root mean square of the rows' distances from the flight [m]."""


def _count(positions: FloatArray, velocities: FloatArray, rows: IntArray) -> _Count:
    """Finds the frames of rows between two bounces, with a second guess after a poor fit."""
    by_reader = _settle((rows - rows[0]) * READER_PERIOD, positions)
    if by_reader.distance < CLOSE:
        return by_reader
    durations = _durations(positions, velocities)
    by_speed = _settle(np.cumsum(np.concatenate([[0.0], durations])), positions)
    return min(by_reader, by_speed, key=lambda count: count.distance)


def _settle(times: FloatArray, positions: FloatArray) -> _Count:
    """Finds frames near `times` (n,) [s] that agree with a flight fitted to them."""
    frames = np.zeros(0, dtype=np.int64)
    flight: Flight | None = None
    for _ in range(MAX_ROUNDS):
        flight = fit_segment(times, positions, start=flight)
        # delay of each row on the flight relative to its stamp => frame
        flown, speed = flight.at(times)
        misses = positions - flown
        late = np.sum(misses * speed, axis=1) / np.sum(speed**2, axis=1)
        again = _whole((times + late) / FRAME_PERIOD)
        if np.array_equal(again, frames):
            again = again + _missed(flight, frames, misses, speed)
        if np.array_equal(again, frames):
            break
        frames = again
        times = frames.astype(np.float64) * FRAME_PERIOD
    assert flight is not None
    return _Count(frames, flight, float(np.sqrt(np.mean(np.sum(misses**2, axis=1)))))


def _missed(flight: Flight, frames: IntArray, misses: FloatArray, speed: FloatArray) -> IntArray:
    """Returns frames (n,) to add: one more or less from some row on, if that reduces the distances.

    A fitted flight adapts to a missed frame in its middle, so that no single row is an outlier:
    each cut is rated by the residual after the best flight for this cut, to first order.
    """
    times = frames.astype(np.float64) * FRAME_PERIOD
    _, slopes = sloped(lambda tried: fly(tried, times)[0], flight.unknowns, SCALES)
    matrix = np.vstack([slopes.reshape(-1, 10) / POSITION_NOISE, np.diag(BELIEFS)])
    basis = np.linalg.qr(matrix * SCALES)[0][: misses.size]
    left = misses.ravel() / POSITION_NOISE

    # column c: change of the misses if all rows after c are one frame later
    later = np.tri(len(frames), k=-1)[:, :-1]
    shifts = (later[:, None, :] * (speed * FRAME_PERIOD)[..., None]).reshape(misses.size, -1)
    shifts /= POSITION_NOISE
    shifts -= basis @ (basis.T @ shifts)
    along, size = left @ shifts, np.sum(shifts**2, axis=0)

    gains = np.stack([2 * along - size, -2 * along - size])
    gains[1, np.diff(frames) == 1] = -np.inf
    sign, cut = np.unravel_index(np.argmax(gains), gains.shape)
    if gains[sign, cut] < CLEAR_GAIN * np.sum(left**2):
        return np.zeros_like(frames)
    added: IntArray = np.where(np.arange(len(frames)) > cut, 1 - 2 * sign, 0)
    return added


def _durations(positions: FloatArray, velocities: FloatArray) -> FloatArray:
    """Durations from row to row (n - 1,) [s]: distance over smoothed recorded velocity."""
    rows = np.arange(len(positions), dtype=np.float64)
    windows = sliding_window_view(np.pad(velocities, ((2, 2), (0, 0)), mode="edge"), 5, axis=0)
    calm = np.median(windows, axis=-1)
    # velocities next to a bounce are mixed with ones from its other side
    inner = slice(NEAR_BOUNCE, -NEAR_BOUNCE) if len(rows) > 4 * NEAR_BOUNCE else slice(None)
    polynomial = np.polynomial.polynomial.polyfit(rows[inner], calm[inner], min(2, len(rows) - 1))
    speed = np.polynomial.polynomial.polyval(rows[1:] - 0.5, polynomial).T
    distance = np.diff(positions, axis=0)
    durations: FloatArray = np.sum(distance * speed, axis=1) / np.sum(speed**2, axis=1)
    return durations


def _whole(frames: FloatArray) -> IntArray:
    """Rounds `frames` (n,) to strictly rising whole frames from 0.

    The fraction is the same for most rows (the time of the first frame), and is removed
    before rounding.
    """
    phase = float(np.angle(np.mean(np.exp(2j * np.pi * frames)))) / (2 * np.pi)
    steps = np.arange(len(frames))
    apart: IntArray = np.maximum.accumulate(np.rint(frames - phase).astype(np.int64) - steps)
    whole: IntArray = apart + steps - apart[0]
    return whole


def _gap(before: Flight, after: Flight, frame: int, lowest: FloatArray) -> tuple[int, int]:
    """Frames from the last row before a bounce, `frame`, to the first row after, and to the lowest.

    Chooses the gap with the closest meeting of the two flights.
    """
    best = (np.inf, 2, 1)
    start = frame * FRAME_PERIOD
    for ahead in range(2, LONGEST_GAP + 1):
        shifted = replace(after, origin=start + ahead * FRAME_PERIOD)
        time, _ = meeting(before, shifted, start, start + ahead * FRAME_PERIOD)
        at = np.array([time])
        apart = float(np.linalg.norm(before.at(at)[0] - shifted.at(at)[0]))
        # the lowest row is on one of the two flights
        between = np.arange(1, ahead)
        times = start + between.astype(np.float64) * FRAME_PERIOD
        path = np.where((times < time)[:, None], before.at(times)[0], shifted.at(times)[0])
        off = np.linalg.norm(path - lowest, axis=1)
        best = min(best, (apart + float(off.min()), ahead, int(between[off.argmin()])))
    return best[1], best[2]
