"""Selects the rows of a history around each of several times."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from o80.joining.sources import Timed
from o80.rows.columns import columns_of
from o80.rows.history import History
from o80.rows.layout import with_padding

NANOSECOND = 1e-9
NOWHERE = np.iinfo(np.int64).max  # age where there is no row [ns]


class Picked(NamedTuple):
    """Rows for T times."""

    rows: NDArray[np.void]  #: (T,)
    age: NDArray[np.int64]  #: (T,) time minus row time; NOWHERE without a row [ns]


def before(source: Timed, times: NDArray[np.int64]) -> Picked:
    """Picks the newest rows captured at or before each time."""
    return _picked(source, times, np.searchsorted(source.times, times, side="right") - 1)


def nearest(source: Timed, times: NDArray[np.int64]) -> Picked:
    """Picks the rows captured nearest to each time; the older of two equally near rows."""
    if not len(source.times):
        return before(source, times)
    right = np.searchsorted(source.times, times, side="left").clip(max=len(source.times) - 1)
    left = np.maximum(right - 1, 0)
    nearer = np.abs(source.times[right] - times) < np.abs(times - source.times[left])
    return _picked(source, times, np.where(nearer, right, left))


def linear(source: Timed, times: NDArray[np.int64]) -> Picked:
    """Interpolates between the rows around each time; numbers other than floats are the older ones.

    The age is that of the newer or the older row, whichever is further from the time. No row is
    found before the first and after the last one.
    """
    left = np.searchsorted(source.times, times, side="right") - 1
    inside = (left >= 0) & (left < len(source.times))
    right = np.minimum(left + 1, len(source.times) - 1)
    picked = before(source, times)
    if not inside.any():
        return picked
    left, right = np.maximum(left, 0), np.maximum(right, 0)
    since, until = times - source.times[left], source.times[right] - times
    inside &= (since == 0) | (until >= 0)
    span = np.maximum(source.times[right] - source.times[left], 1)
    share = np.where(since == 0, 0.0, since / span)
    older, newer = (_rows(source, place) for place in (left, right))
    mixed = _rows(source, left)
    for column in columns_of(source.history.schema):
        if column.dtype.kind != "f":
            continue
        place = column.dtype, column.offset
        a, b = older.getfield(*place), newer.getfield(*place)
        mixed.getfield(*place)[...] = np.where(share == 0.0, a, a + (b - a) * share)
    age = np.where(since == 0, 0, np.maximum(since, until))
    return Picked(mixed, np.where(inside, age, NOWHERE))


def _picked(source: Timed, times: NDArray[np.int64], places: NDArray[np.intp]) -> Picked:
    found = places >= 0
    if not len(source.times):
        return Picked(np.zeros(len(times), source.history.rows.dtype), np.full(len(times), NOWHERE))
    places = np.maximum(places, 0)
    age = np.where(found, times - source.times[places], NOWHERE)
    return Picked(_rows(source, places), age)


def _rows(source: Timed, places: NDArray[np.intp]) -> NDArray[np.void]:
    """Returns a copy of these rows."""
    rows = source.history.rows
    return with_padding(rows)[source.rows[places]].view(rows.dtype)


def blanked(history: History, rows: NDArray[np.void], missing: NDArray[np.bool_]) -> None:
    """Sets all numbers of missing rows to NaN, or to 0 where there is no NaN."""
    if not missing.any():
        return
    raw = rows.view(np.uint8).reshape(len(rows), -1)
    raw[missing] = 0
    for column in columns_of(history.schema):
        if column.dtype.kind == "f":
            rows.getfield(column.dtype, column.offset)[missing] = np.nan
