"""Computes the observation `full` of N episodes, bit for bit as of each episode alone."""

from __future__ import annotations

import numpy as np

from o80.base.arrays import FloatArray, IntArray

from ..physics.ball_filter import FilterSettings, ball_filter
from ..world.arm import MUSCLES
from .full_observation import FullObservation
from .noise import NoiseSettings
from .perception import EVERY, Perceived
from .state import State

MIN_POSITION_NOISE = 0.0005
"""Least position noise of the filter, because the laws are not quite exact [m]."""
MIN_VELOCITY_NOISE = 0.02
"""Least velocity noise of the filter [m/s]."""


class FullObserver:
    """Observer of N episodes (`count`): adds recent commands and a filtered ball to the state.

    `interval`: time between observations [s]. `largest_change`: of a commanded pressure in that
    time, normalised.
    """

    def __init__(
        self,
        full: FullObservation,
        noise: NoiseSettings,
        interval: float,
        largest_change: float,
        count: int,
    ) -> None:
        self._plane, self._interval, self._latency = full.plane, interval, noise.latency
        self._per_change = 1.0 / largest_change
        self._centres, self._per_scale = full.centres, 1.0 / full.scales
        places = full.places()
        self._pressures, self._asked = places["pressures"], places["asked"]
        self._motion = slice(0, self._pressures.start)
        self._racket, self._time = places["racket"], places["time"].start
        begin, end = places["changes"].start, places["changes"].stop
        self._changes, self._newest = slice(begin, end), slice(begin, begin + MUSCLES)
        self._earlier = slice(begin + MUSCLES, end)
        self._later = slice(begin, end - MUSCLES)
        position = max(noise.ball_position, MIN_POSITION_NOISE)
        velocity = max(noise.ball_velocity, MIN_VELOCITY_NOISE)
        self._filter = ball_filter(FilterSettings(interval, position, velocity), count)
        self._every = np.arange(count)
        self._rows = np.zeros((count, len(self._centres)))
        self._last = np.zeros((count, MUSCLES))

    def begin(self, state: State, seen: Perceived, which: IntArray) -> FloatArray:
        """Computes the first observations (n, M) of new episodes, scaled."""
        self._rows[which, self._changes] = 0.0
        self._last[which] = state.asked
        self._filter.begin(seen.ball, which)
        return self._scaled(self._rows[which], state, seen, which)

    def observe(self, state: State, seen: Perceived, which: IntArray | slice = EVERY) -> FloatArray:
        """Computes the observations (n, M) of some episodes after a step, scaled."""
        rows = self._rows[which]
        # shifts the changes, and adds the newest one
        rows[:, self._earlier] = rows[:, self._later].copy()
        rows[:, self._newest] = (state.asked - self._last[which]) * self._per_change
        self._rows[which], self._last[which] = rows, state.asked
        if seen.first:
            self._filter.begin(seen.ball, self._every[which])
        else:
            self._filter.step(seen.ball, np.asarray(seen.missed), self._every[which])
        return self._scaled(rows, state, seen, which)

    def _scaled(
        self, rows: FloatArray, state: State, seen: Perceived, which: IntArray | slice
    ) -> FloatArray:
        rows[:, self._motion] = state.motion
        rows[:, self._pressures] = seen.pressures
        rows[:, self._asked] = state.asked
        rows[:, self._racket] = state.racket
        time = self._time
        rows[:, time] = state.steps * self._interval
        rows[:, time + 1 :] = self._filter.estimates(self._plane, self._every[which])
        rows[:, -1] -= self._latency
        return (rows - self._centres) * self._per_scale
