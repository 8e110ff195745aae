"""Estimates the delay between two segments that see the same motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import o80._core as _core
from o80.base.arrays import FloatArray
from o80.base.errors import Error, InvalidArgument
from o80.joining.row_selection import NANOSECOND
from o80.joining.sources import Timed, timed
from o80.rows.columns import Column, columns_of
from o80.rows.history import History, values_of

if TYPE_CHECKING:
    from o80.joining.sources import Source

    Signal = str | Callable[[History], Any]


BLOCKS = 10  # of the jackknife
MIN_ROWS = 50
MIN_CORRELATION = 0.5


@dataclass(frozen=True)
class Latency:
    """How much later one signal shows a motion than another."""

    seconds: float
    """Delay of the second signal behind the first [s]; negative if it is ahead."""
    uncertainty: float
    """Standard error, from a jackknife over ten parts of the time [s]."""
    correlation: float
    """Correlation of the two signals at this delay, at most 1."""
    samples: int
    """Times at which the signals were compared."""

    def __str__(self) -> str:
        return (
            f"{1e3 * self.seconds:.2f} ms +- {1e3 * self.uncertainty:.2f} ms "
            f"(correlation {self.correlation:.3f}, {self.samples} samples)"
        )


def latency(
    first: tuple[Source, Signal],
    second: tuple[Source, Signal],
    *,
    most: float = 0.5,
    seconds: float | None = None,
) -> Latency:
    """The delay of the second signal behind the first one, by cross-correlation.

    first, second: a source as for `align` and a number of its rows, such as "observed.elbow"; or a
        function that makes numbers (T,) of a History, such as the speed of a body.
    most: longest delay to look for, either way [s].
    seconds: only the last seconds of both.

    Both signals are interpolated at the smaller of their periods, and compared by their
    correlation coefficient for each delay. The motion must not repeat itself within `most`.
    Raises InvalidArgument, and Error if the signals show no common motion.
    """
    (one_source, one_signal), (other_source, other_signal) = first, second
    found = timed({"first": one_source, "second": other_source}, seconds=seconds)
    one, other = found["first"], found["second"]
    step, grid = _grid(one, other, most)
    lags = int(most / (step * NANOSECOND))
    x = _sampled(one, one_signal, grid)
    y = _sampled(other, other_signal, grid)
    if len(grid) < 2 * lags + MIN_ROWS:
        raise InvalidArgument(
            f"both sources have rows for {len(grid) * step * NANOSECOND:.3g} s only, too little "
            f"for delays up to {most:g} s: record longer, or give a smaller most"
        )
    return _estimate(x, y, lags, step * NANOSECOND)


def _grid(one: Timed, other: Timed, most: float) -> tuple[int, NDArray[np.int64]]:
    """Period [ns] and times while both sources have rows."""
    if not 0 < most < 1e6:
        raise InvalidArgument(f"most must be a positive number of seconds, got {most!r}")
    for name, source in (("first", one), ("second", other)):
        if len(source.times) < MIN_ROWS:
            raise InvalidArgument(
                f"the {name} source has {len(source.times)} rows, at least {MIN_ROWS} are needed"
            )
    step = int(min(np.median(np.diff(source.times)) for source in (one, other)))
    begin = max(int(one.times[0]), int(other.times[0]))
    end = min(int(one.times[-1]), int(other.times[-1]))
    return step, np.arange(begin, end + 1, step, dtype=np.int64)


def _sampled(source: Timed, signal: Signal, grid: NDArray[np.int64]) -> FloatArray:
    """A signal at times, without its mean and its trend."""
    history = source.history
    if callable(signal):
        values = np.asarray(signal(history), np.float64)
        if values.shape != (len(history),):
            raise InvalidArgument(
                f"the function of a signal must return numbers ({len(history)},), one for each "
                f"row, got {values.shape}"
            )
    else:
        values = values_of(history, _column(history, signal)).astype(np.float64)
    values = values[source.rows]
    whole = np.isfinite(values)
    if whole.sum() < MIN_ROWS:
        raise InvalidArgument(f"the signal has only {whole.sum()} numbers that are finite")
    begin = source.times[0]
    sampled: FloatArray = np.interp(grid - begin, source.times[whole] - begin, values[whole])
    if len(sampled) < 2:
        return sampled
    place = np.arange(len(sampled), dtype=np.float64)
    slope, middle = np.polyfit(place, sampled, 1)
    rest: FloatArray = sampled - (slope * place + middle)
    return rest


def _column(history: History, path: str) -> Column:
    found = columns_below(history, path)
    if len(found) == 1:
        return found[0]
    raise InvalidArgument(
        f"'{path}' names {len(found)} numbers ({found[0].name}, ...): choose one, or give a "
        "function that makes one of them"
    )


def _estimate(x: FloatArray, y: FloatArray, lags: int, period: float) -> Latency:
    """y is compared with x from `lags` samples earlier to `lags` later."""
    middle = np.arange(lags, len(x) - lags)
    blocks = np.array_split(middle, BLOCKS)
    shifts = np.arange(-lags, lags + 1)
    moments = np.empty((BLOCKS, len(shifts), 6))
    for number, block in enumerate(blocks):
        mine = x[block]
        for place, shift in enumerate(shifts):
            others = y[block[0] + shift : block[-1] + 1 + shift]
            moments[number, place] = (
                len(block),
                mine.sum(),
                others.sum(),
                mine @ mine,
                others @ others,
                mine @ others,
            )
    total = moments.sum(axis=0)
    correlation, best = _peak(total)
    if correlation < MIN_CORRELATION or abs(best - lags) > lags - 1:
        raise Error(
            "the two signals show no common motion within the longest delay (correlation "
            f"{correlation:.2f}): move more, compare other fields, or give a larger most"
        )
    without = np.array([_peak(total - each)[1] for each in moments])
    spread = np.sqrt((BLOCKS - 1) / BLOCKS * np.sum((without - without.mean()) ** 2))
    return Latency(
        float((best - lags) * period), float(spread * period), float(correlation), len(middle)
    )


def _peak(moments: FloatArray) -> tuple[float, float]:
    """The largest correlation, and its place, between samples by a parabola."""
    n, sum_x, sum_y, xx, yy, xy = moments.T
    variance = np.maximum((n * xx - sum_x**2) * (n * yy - sum_y**2), 0)
    share = np.divide(
        n * xy - sum_x * sum_y, np.sqrt(variance), out=np.zeros_like(xy), where=variance > 0
    )
    best = int(np.argmax(share))
    if not 0 < best < len(share) - 1:
        return float(share[best]), float(best)
    left, top, right = share[best - 1 : best + 2]
    bend = left - 2 * top + right
    return float(top), best + (0.5 * float((left - right) / bend) if bend < 0 else 0.0)


def columns_below(history: History, path: str) -> list[Column]:
    """The number that a path names, or all numbers below it. Raises InvalidArgument for none."""
    columns = {column.name: column for column in columns_of(history.schema)}
    chosen = [
        column
        for name, column in columns.items()
        if name == path or name.startswith((path + ".", path + "["))
    ]
    if not chosen:
        instead = _core.names_instead(path, list(columns))
        raise InvalidArgument(f"there is no field '{path}'{instead}")
    return chosen


def norm_of(path: str) -> Callable[[History], NDArray[np.float64]]:
    """Makes the Euclidean norm (T,) of all numbers below a path, such as "extended.velocity"."""

    def norm(history: History) -> NDArray[np.float64]:
        chosen = columns_below(history, path)
        numbers = [values_of(history, column).astype(np.float64) for column in chosen]
        length: NDArray[np.float64] = np.linalg.norm(numbers, axis=0)
        return length

    return norm
