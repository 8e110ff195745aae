"""The line below points that lie above it by a delay that varies.

A stamp arrives late, never early. Of the points (time of the device, arrival less that time) the
lowest ones are therefore nearest to the truth, and a mean would be wrong by the mean delay. The
line is the solution of the linear program "below all points, least sum of distances": the edge of
the lower convex hull over the mean of the times (Moon, Skelly and Towsley, 1999).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice, pairwise
from statistics import median

WANDER = 2e-7  # by which rates of quartz clocks change within minutes
NEWEST_KEPT = 4  # buckets that stay although they are older than the window


@dataclass
class Bucket:
    """The lowest of the points in an interval of time."""

    begin: float  #: [ns]
    x: float
    y: float
    count: int
    above: float = 0.0  #: sum of the distances from the line [ns]


class LowerEnvelope:
    """A line y = base + rate x below the points of the last `window`, from their lowest ones."""

    def __init__(
        self, *, window: float, bucket: float, max_rate: float, rate: float, rate_error: float
    ) -> None:
        """Window and buckets in it: lengths [ns]. max_rate: bound of |rate|.

        rate, rate_error: estimate of the rate before any point, and its standard error.
        """
        self._window = window
        self._bucket = bucket
        self._max_rate = max_rate
        self._prior = (rate, rate_error)
        self._buckets: deque[Bucket] = deque()
        self._base = 0.0
        self._lowest_scatter = self._least_error = self._middle = 0.0
        self.rate, self.rate_error = rate, rate_error

    def __bool__(self) -> bool:
        return bool(self._buckets)

    @property
    def count(self) -> int:
        """Number of points in the window."""
        return sum(each.count for each in self._buckets)

    @property
    def buckets(self) -> int:
        return len(self._buckets)

    def at(self, x: float) -> float:
        return self._base + self.rate * x

    def above(self, x: float, y: float) -> float:
        """How far a point lies above the line; negative below it."""
        return y - self.at(x)

    def add(self, x: float, y: float) -> None:
        """Adds a point, later than all before it. The line is then not above it."""
        if not self._buckets or x >= self._buckets[-1].begin + self._bucket:
            self._begin_bucket(x, y)
        above = self.above(x, y)
        if above < 0.0:
            self._base += above
            self._lowest_scatter -= above
            above = 0.0
        last = self._buckets[-1]
        if y - self.rate * x < last.y - self.rate * last.x:
            last.x, last.y = x, y
        last.count += 1
        last.above += above

    def _begin_bucket(self, x: float, y: float) -> None:
        while len(self._buckets) > NEWEST_KEPT and self._buckets[0].begin < x - self._window:
            self._buckets.popleft()
        if self._buckets:
            self._fit()
        else:
            self._base = y - self.rate * x
        self._buckets.append(Bucket(x, x, y, count=0))

    def _fit(self) -> None:
        """Rate and base from the lowest points of the buckets."""
        points = [(each.x, each.y) for each in self._buckets]
        span = points[-1][0] - points[0][0]
        rate, error = self._prior
        if len(points) > 2 and span > 0.0:
            slope, intercept = edge_at_mean(points)
            scatter = median(y - intercept - slope * x for x, y in points)
            # a hull touches at least two points: its slope cannot be better than one nanosecond
            fitted = 4.0 * (scatter + 1.0) / span
            trust = error**2 / (error**2 + fitted**2)
            rate += trust * (slope - rate)
            error = trust**0.5 * fitted
        self.rate = min(max(rate, -self._max_rate), self._max_rate)
        self.rate_error = max(error, WANDER)
        self._base = min(y - self.rate * x for x, y in points)
        self._lowest_scatter = median(self.above(x, y) for x, y in points)
        self._least_error = 2.0 * self.scatter() / math.sqrt(self.count)
        self._middle = sum(x for x, _ in points) / len(points)

    @property
    def error(self) -> float:
        """Error of the line where its points are [ns].

        The median distance of the lowest points of the buckets: not the mean, because a bucket
        whose packets all waited in a queue tells nothing. A few buckets may lie on the line by
        chance.
        """
        return max(self._lowest_scatter, self._least_error)

    def scatter(self, but_last: int = 0) -> float:
        """Mean distance of points from the line [ns], without those of the newest buckets."""
        chosen = list(self._buckets)[: max(0, len(self._buckets) - but_last)]
        count = sum(each.count for each in chosen)
        return sum(each.above for each in chosen) / count if count else 0.0

    def least_above(self, newest: int) -> float:
        """The least distance from the line in the newest buckets [ns]."""
        return min(self.above(each.x, each.y) for each in self._newest(newest))

    def newest_count(self, newest: int) -> int:
        """Number of points in the newest buckets."""
        return sum(each.count for each in self._newest(newest))

    def _newest(self, count: int) -> Iterator[Bucket]:
        return islice(reversed(self._buckets), count)

    def from_middle(self, x: float) -> float:
        """How far x is from the mean of the window [ns]: there the rate matters least."""
        return abs(x - self._middle)


def edge_at_mean(points: list[tuple[float, float]]) -> tuple[float, float]:
    """Slope and intercept of the edge of the lower hull over the mean of x. x must increase."""
    hull: list[tuple[float, float]] = []
    for x, y in points:
        while len(hull) > 1 and _turns_down(hull[-2], hull[-1], (x, y)):
            hull.pop()
        hull.append((x, y))
    mean = sum(x for x, _ in points) / len(points)
    for (x0, y0), (x1, y1) in pairwise(hull):
        if x1 >= mean:
            slope = (y1 - y0) / (x1 - x0)
            return slope, y0 - slope * x0
    raise ValueError("points must be at least two, with different x")


def _turns_down(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> bool:
    """Whether b lies on or above the line from a to c."""
    return (b[1] - a[1]) * (c[0] - a[0]) >= (c[1] - a[1]) * (b[0] - a[0])
