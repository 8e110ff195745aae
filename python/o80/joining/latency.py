"""Estimates the delay between two segments that record the same motion."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from o80.base.arrays import FloatArray
from o80.base.errors import Error, InvalidArgument
from o80.joining.row_selection import NANOSECOND
from o80.joining.sources import CAPTURE_ERROR, Timed, timed
from o80.rows.history import History

if TYPE_CHECKING:
    from o80.joining.sources import Source

    Signal = str | Callable[[History], Any]


BLOCKS = 20  # blocks of the jackknife
WIDTH = 1.5  # width of the smoothing, in periods
STEPS = 4  # samples in this width
MIN_WEIGHT = 0.5  # least weight of rows around a time; 1: no row is missing
MIN_ROWS = 50
MIN_CORRELATION = 0.5


@dataclass(frozen=True)
class Latency:
    """Delay between two signals of the same motion."""

    seconds: float  #: delay of the second signal behind the first [s]; negative if it is ahead
    uncertainty: float
    """Standard error: a jackknife over 20 parts of the time, and the errors of capture times that
    devices state (`capture_error`) [s]."""
    correlation: float  #: correlation of the two signals at this delay, at most 1
    samples: int  #: times at which the signals were compared

    def __str__(self) -> str:
        return (
            f"{1e3 * self.seconds:.2f} ms +- {1e3 * self.uncertainty:.2f} ms "
            f"(correlation {self.correlation:.3f}, {self.samples} samples)"
        )


def latency(
    first: "tuple[Source, Signal]",
    second: "tuple[Source, Signal]",
    *,
    most: float = 0.5,
    seconds: float | None = None,
) -> Latency:
    """Estimates the delay of the second signal behind the first one, by cross-correlation.

    first, second: a source as for `align` and the path of a number, such as "observed.elbow"; or a
        function that computes numbers (T,) from a History, such as the speed of a body.
    most: longest delay to consider, in both directions [s].
    seconds: only the last seconds of both.

    Both signals are smoothed alike, over 1.5 periods of the slower one, and compared by their
    correlation coefficient for each delay. Times at which one of them has no rows are left out.
    The motion must not repeat itself within `most`.
    Raises InvalidArgument for too few rows or unknown fields, Error without a common motion.
    """
    (one_source, one_signal), (other_source, other_signal) = first, second
    found = timed({"first": one_source, "second": other_source}, seconds=seconds)
    one, other = found["first"], found["second"]
    begin, end, width = _extent(one, other, most)
    x = _smooth(one, one_signal, begin, end, width)
    y = _smooth(other, other_signal, begin, end, width)
    step = width / STEPS * NANOSECOND
    lags = int(most / step)
    if len(x) < 2 * lags + 2 * BLOCKS:
        raise InvalidArgument(
            f"both sources have rows for {(end - begin) * NANOSECOND:.3g} s only, too little "
            f"for delays up to {most:g} s: record longer, or give a smaller most"
        )
    found_at = _estimate(x, y, lags, step)
    captured = sum(_capture_error(source) ** 2 for source in (one, other))
    samples = round(found_at.samples * width / STEPS / _period(one, other))
    uncertainty = float(np.hypot(found_at.uncertainty, np.sqrt(captured)))
    return replace(found_at, uncertainty=uncertainty, samples=samples)


def _period(one: Timed, other: Timed) -> int:
    """Returns the larger of both periods [ns]."""
    return int(max(np.median(np.diff(source.times)) for source in (one, other)))


def _extent(one: Timed, other: Timed, most: float) -> tuple[int, int, float]:
    """Returns the first and the last common time, and the width of the smoothing [ns]."""
    if not 0 < most < 1e6:
        raise InvalidArgument(f"most must be a positive number of seconds, got {most!r}")
    for name, source in (("first", one), ("second", other)):
        if len(source.times) < MIN_ROWS:
            raise InvalidArgument(
                f"the {name} source has {len(source.times)} rows, at least {MIN_ROWS} are needed"
            )
    begin = max(int(one.times[0]), int(other.times[0]))
    end = min(int(one.times[-1]), int(other.times[-1]))
    return begin, end, WIDTH * _period(one, other)


def _smooth(source: Timed, signal: "Signal", begin: int, end: int, width: float) -> FloatArray:
    """Resamples a signal at uniform times, NaN where it has no rows.

    Each sample is the mean of the rows around it, weighted by a Gaussian of this width: it removes
    noise at frequencies for which the place of a sample between two rows would matter.
    """
    values, times = _numbers(source, signal)
    step = width / STEPS
    count = max(int((end - begin) // step) + 1, 1)
    place = (times - begin) / step
    inside = (place >= 0) & (place < count - 1)
    place, values = place[inside], values[inside]
    left = place.astype(np.intp)
    share = place - left
    middle = values.mean() if len(values) else 0.0
    sums, weights = np.zeros(count), np.zeros(count)
    for at, weight in ((left, 1 - share), (left + 1, share)):
        sums += np.bincount(at, weight * (values - middle), count)
        weights += np.bincount(at, weight, count)
    offsets = np.arange(-3 * STEPS, 3 * STEPS + 1) / STEPS
    kernel = np.exp(-0.5 * offsets**2)
    sums = np.convolve(sums, kernel)[3 * STEPS : 3 * STEPS + count]
    weights = np.convolve(weights, kernel)[3 * STEPS : 3 * STEPS + count]
    usual = float(np.median(weights))
    smooth: FloatArray = np.full(count, np.nan)
    has_rows = weights > MIN_WEIGHT * usual
    smooth[has_rows] = sums[has_rows] / weights[has_rows]
    return smooth


def _numbers(source: Timed, signal: "Signal") -> tuple[FloatArray, NDArray[np.int64]]:
    """Returns the finite numbers of a signal, and their times [ns]."""
    history = source.history
    given = signal(history) if callable(signal) else history[signal]
    values = np.asarray(given, np.float64)
    if values.shape != (len(history),):
        named = "the function of a signal" if callable(signal) else f"'{signal}'"
        raise InvalidArgument(
            f"{named} must give ({len(history)},), a number for each row, got {values.shape}: "
            f"choose one of several numbers, or give a function that makes one of them"
        )
    values = values[source.rows]
    whole = np.isfinite(values)
    if whole.sum() < MIN_ROWS:
        raise InvalidArgument(f"the signal has only {whole.sum()} numbers that are finite")
    return values[whole], source.times[whole]


def _capture_error(source: Timed) -> float:
    """Returns the common error of all capture times, as stated by the device [s]."""
    if CAPTURE_ERROR not in source.history.extended:
        return 0.0
    errors = np.asarray(getattr(source.history.extended, CAPTURE_ERROR))[source.rows]
    return float(np.median(errors)) * NANOSECOND


def _estimate(x: FloatArray, y: FloatArray, lags: int, period: float) -> Latency:
    """Compares y with x, from `lags` samples earlier to `lags` later."""
    count = len(x) - 2 * lags
    begins = np.linspace(0, count, BLOCKS, endpoint=False).astype(np.intp)
    has_x, has_y = np.isfinite(x)[lags : lags + count], np.isfinite(y)
    x, y = np.nan_to_num(x)[lags : lags + count], np.nan_to_num(y)
    time = np.linspace(-1.0, 1.0, count)
    moments = np.empty((BLOCKS, 2 * lags + 1, 10))
    for place in range(2 * lags + 1):
        other, has_both = y[place : place + count], has_x & has_y[place : place + count]
        t, mine, theirs = time * has_both, x * has_both, other * has_both
        products = [has_both, t, t * time, mine, t * x, theirs, t * other]
        products += [mine * x, theirs * other, mine * other]
        moments[:, place] = np.add.reduceat(np.array(products, np.float64), begins, axis=1).T
    total = moments.sum(axis=0)
    correlation, best = _peak(total)
    if correlation < MIN_CORRELATION or abs(best - lags) > lags - 1:
        raise Error(
            "the two signals show no common motion within the longest delay (correlation "
            f"{correlation:.2f}): move more, compare other fields, or give a larger most"
        )
    filled = [each for each in moments if each[:, 0].any()]
    without = np.array([_peak(total - each)[1] for each in filled])
    spread = np.sqrt((len(filled) - 1) / len(filled) * np.sum((without - without.mean()) ** 2))
    return Latency(
        float((best - lags) * period),
        float(spread * period),
        float(correlation),
        int(total[round(best), 0]),
    )


def _peak(moments: FloatArray) -> tuple[float, float]:
    """Returns the largest correlation, and its place, interpolated by a parabola.

    At each delay the best-fitting line of each signal is subtracted first: it is no motion.
    """
    n, t, tt, x, tx, y, ty, xx, yy, xy = moments.T
    det = n * tt - t * t
    det = np.where(det > 0, det, np.inf)

    def without_line(
        square: FloatArray, a: FloatArray, ta: FloatArray, b: FloatArray, tb: FloatArray
    ) -> FloatArray:
        line: FloatArray = (tt * a * b - t * (a * tb + ta * b) + n * ta * tb) / det
        return square - line

    of_x = np.maximum(without_line(xx, x, tx, x, tx), 0)
    of_y = np.maximum(without_line(yy, y, ty, y, ty), 0)
    both = without_line(xy, x, tx, y, ty)
    norm = np.sqrt(of_x * of_y)
    moving = norm > 1e-9 * np.sqrt(xx * yy)
    share = np.divide(both, norm, out=np.zeros_like(xy), where=moving)
    best = int(np.argmax(share))
    if not 0 < best < len(share) - 1:
        return float(share[best]), float(best)
    left, top, right = share[best - 1 : best + 2]
    bend = left - 2 * top + right
    return float(top), best + (0.5 * float((left - right) / bend) if bend < 0 else 0.0)
