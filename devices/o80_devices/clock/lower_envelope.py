"""Fits the line below points that are above the line by a varying delay.

A stamp arrives late, never early. The lowest of the points (device time, arrival minus device
time) are therefore the most accurate, and a mean would be wrong by the mean delay. The
line solves the linear program "below all points, least sum of distances": it is the edge of
the lower convex hull over the mean of the times (Moon, Skelly and Towsley, 1999).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice, pairwise
from statistics import median

WINDOW = 30e9  # length of the interval whose points determine the line [ns]
BUCKET = 0.5e9  # only the lowest point of a bucket is stored [ns]
MAX_RATE = 5e-4  # largest relative difference of two clocks' rates
WANDER = 2e-7  # drift of a quartz clock's rate within minutes
NEWEST_KEPT = 4  # buckets that are kept beyond the window


@dataclass
class Bucket:
    """Lowest point of a time interval."""

    begin: float  #: [ns]
    x: float
    y: float
    count: int
    above: float = 0.0  #: sum of the distances from the line [ns]


class LowerEnvelope:
    """Line y = base + rate x below all points of the last WINDOW."""

    def __init__(self, rate: float, rate_error: float) -> None:
        """Takes an estimate of the rate before the first point, and its standard error."""
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
        """Distance of a point above the line; negative below."""
        return y - self.at(x)

    def add(self, x: float, y: float) -> None:
        """Adds a point, later than all others; lowers the line to the point if necessary."""
        if not self._buckets or x >= self._buckets[-1].begin + BUCKET:
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
        while len(self._buckets) > NEWEST_KEPT and self._buckets[0].begin < x - WINDOW:
            self._buckets.popleft()
        if self._buckets:
            self._fit()
        else:
            self._base = y - self.rate * x
        self._buckets.append(Bucket(x, x, y, count=0))

    def _fit(self) -> None:
        """Fits rate and base to the lowest points of the buckets."""
        points = [(each.x, each.y) for each in self._buckets]
        span = points[-1][0] - points[0][0]
        rate, error = self._prior
        if len(points) > 2 and span > 0.0:
            slope, intercept = edge_at_mean(points)
            scatter = median(y - intercept - slope * x for x, y in points)
            # a hull edge touches two points exactly: at least one nanosecond of scatter is assumed
            fitted = 4.0 * (scatter + 1.0) / span
            trust = error**2 / (error**2 + fitted**2)
            rate += trust * (slope - rate)
            error = trust**0.5 * fitted
        self.rate = min(max(rate, -MAX_RATE), MAX_RATE)
        self.rate_error = max(error, WANDER)
        self._base = min(y - self.rate * x for x, y in points)
        self._lowest_scatter = median(self.above(x, y) for x, y in points)
        self._least_error = 2.0 * self.scatter() / math.sqrt(self.count)
        self._middle = sum(x for x, _ in points) / len(points)

    @property
    def error(self) -> float:
        """Error of the line within the window [ns].

        Median distance of the buckets' lowest points; a mean would count buckets in which all
        packets were queued. A few buckets may lie on the line by
        chance.
        """
        return max(self._lowest_scatter, self._least_error)

    def scatter(self, but_last: int = 0) -> float:
        """Mean distance of points from the line [ns], without the newest `but_last` buckets."""
        chosen = list(self._buckets)[: max(0, len(self._buckets) - but_last)]
        count = sum(each.count for each in chosen)
        return sum(each.above for each in chosen) / count if count else 0.0

    def least_above(self, newest: int) -> float:
        """Least distance from the line in the newest buckets [ns]."""
        return min(self.above(each.x, each.y) for each in self._newest(newest))

    def newest_count(self, newest: int) -> int:
        """Number of points in the newest buckets."""
        return sum(each.count for each in self._newest(newest))

    def _newest(self, count: int) -> Iterator[Bucket]:
        return islice(reversed(self._buckets), count)

    def from_middle(self, x: float) -> float:
        """Distance of x from the window's mean [ns], where an error of the rate has no effect."""
        return abs(x - self._middle)


def edge_at_mean(points: list[tuple[float, float]]) -> tuple[float, float]:
    """Slope and intercept of the lower hull's edge at the mean of x. x must increase."""
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
    raise ValueError("at least two points with different x are needed")


def _turns_down(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> bool:
    """Whether b lies on or above the line from a to c."""
    return (b[1] - a[1]) * (c[0] - a[0]) >= (c[1] - a[1]) * (b[0] - a[0])
