"""Makes the observation `full` of one episode, or of N at once: both get the same bits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..physics.ball_filter import ball_filter
from ..physics.filter_gains import FilterSettings
from ..world.arm import MUSCLES
from .full_observation import FullObservation
from .noise import NoiseSettings
from .perception import Perceived
from .state import State

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

EVERY = slice(None)
LEAST_POSITION_NOISE = 0.0005
"""With less noise the filter still expects so much: the laws are not quite exact [m]."""
LEAST_VELOCITY_NOISE = 0.02
"""[m/s]"""


def filter_settings(noise: NoiseSettings, interval: float) -> FilterSettings:
    """Filter settings for a ball that is seen with this noise, every `interval` [s]."""
    return FilterSettings(
        step=interval,
        position=max(noise.ball_position, LEAST_POSITION_NOISE),
        velocity=max(noise.ball_velocity, LEAST_VELOCITY_NOISE),
    )


class FullObserver:
    """Parts of an observation beyond the state: the latest requests, and the filtered ball.

    `interval` is the time from one observation to the next [s], `largest_change` that of an asked
    pressure in that time, normalised.
    """

    def __init__(
        self, full: FullObservation, noise: NoiseSettings, interval: float, largest_change: float
    ) -> None:
        self._plane, self._interval, self._latency = full.plane, interval, noise.latency
        self._per_change = 1.0 / largest_change
        self._centres, self._per_scale = full.centres, 1.0 / full.scales
        places = full.places()
        self._pressures, self._asked_at = places["pressures"], places["asked"]
        self._motion = slice(0, self._pressures.start)
        self._racket, self._time = places["racket"], places["time"].start
        begin, end = places["changes"].start, places["changes"].stop
        self._changes, self._newest = slice(begin, end), slice(begin, begin + MUSCLES)
        self._earlier = slice(begin + MUSCLES, end)
        self._later = slice(begin, end - MUSCLES)

    def _remember(self, rows: FloatArray, last: FloatArray, asked: FloatArray) -> None:
        """The change of the asked pressures (..., 8) is the newest one in rows (..., M)."""
        rows[..., self._earlier] = rows[..., self._later].copy()
        rows[..., self._newest] = (asked - last) * self._per_change

    def _fill(self, rows: FloatArray, state: State, asked: FloatArray, seen: Perceived) -> None:
        """All but the ball."""
        rows[..., self._motion] = state.motion
        rows[..., self._pressures] = seen.pressures
        rows[..., self._asked_at] = asked
        rows[..., self._racket] = state.racket


class OneFullObserver(FullObserver):
    """Observer of one episode."""

    def __init__(
        self, full: FullObservation, noise: NoiseSettings, interval: float, largest_change: float
    ) -> None:
        super().__init__(full, noise, interval, largest_change)
        self._filter = ball_filter(filter_settings(noise, interval), 1)
        self._row, self._last = np.zeros(len(self._centres)), np.zeros(MUSCLES)

    def begin(
        self, state: State, asked: FloatArray, seen: Perceived, _which: IntArray
    ) -> FloatArray:
        """The first observation (M,) of a new episode, scaled."""
        self._row[self._changes] = 0.0
        self._last[...] = asked
        self._filter.begin(seen.ball[None])
        return self._scaled(state, asked, seen)

    def observe(
        self, state: State, asked: FloatArray, seen: Perceived, _which: IntArray | slice = EVERY
    ) -> FloatArray:
        """The observation (M,) after a step, scaled."""
        self._remember(self._row, self._last, asked)
        self._last[...] = asked
        if seen.first:
            self._filter.begin(seen.ball[None])
        else:
            self._filter.step(seen.ball[None], np.array([seen.missed]))
        return self._scaled(state, asked, seen)

    def _scaled(self, state: State, asked: FloatArray, seen: Perceived) -> FloatArray:
        self._fill(self._row, state, asked, seen)
        self._row[self._time] = state.steps * self._interval
        self._row[self._time + 1 :] = self._filter.estimates(self._plane)[0]
        self._row[-1] -= self._latency
        return (self._row - self._centres) * self._per_scale


class ManyFullObserver(FullObserver):
    """Observer of N episodes."""

    def __init__(
        self,
        full: FullObservation,
        noise: NoiseSettings,
        interval: float,
        largest_change: float,
        count: int,
    ) -> None:
        super().__init__(full, noise, interval, largest_change)
        self._filter = ball_filter(filter_settings(noise, interval), count)
        self._every = np.arange(count)
        self._rows = np.zeros((count, len(self._centres)))
        self._last = np.zeros((count, MUSCLES))

    def begin(
        self, state: State, asked: FloatArray, seen: Perceived, which: IntArray
    ) -> FloatArray:
        """The first observations (n, M) of new episodes, scaled."""
        self._rows[which, self._changes] = 0.0
        self._last[which] = asked
        self._filter.begin(seen.ball, which)
        return self._scaled(self._rows[which], state, asked, seen, which)

    def observe(
        self, state: State, asked: FloatArray, seen: Perceived, which: IntArray | slice = EVERY
    ) -> FloatArray:
        """The observations (n, M) of some episodes after a step, scaled."""
        rows = self._rows[which]
        self._remember(rows, self._last[which], asked)
        self._rows[which], self._last[which] = rows, asked
        self._filter.step(seen.ball, np.asarray(seen.missed), self._every[which])
        return self._scaled(rows, state, asked, seen, which)

    def _scaled(
        self,
        rows: FloatArray,
        state: State,
        asked: FloatArray,
        seen: Perceived,
        which: IntArray | slice,
    ) -> FloatArray:
        self._fill(rows, state, asked, seen)
        time = self._time
        rows[:, time] = np.asarray(state.steps) * self._interval
        rows[:, time + 1 :] = self._filter.estimates(self._plane, self._every[which])
        rows[:, -1] -= self._latency
        return (rows - self._centres) * self._per_scale
