"""Converts the states of N episodes to observations: noise first, then the numbers.

An environment makes one `Observer` from its settings. Noise and filters have a memory: call
`begin` for each new episode, and `observe` exactly once after each step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from gymnasium import spaces

from o80.base.arrays import Float32Array, FloatArray, IntArray

from .ball_play import ReturnTask, observes_as_published
from .full_observation import FullObservation
from .full_observer import FullObserver
from .noise import NO_NOISE, NoiseSettings
from .perception import EVERY, NoisyPerception, Perceived, Perception
from .state import State


class Observer:
    """Observer of N episodes (`count`)."""

    def __init__(
        self,
        task: ReturnTask,
        count: int,
        *,
        noise: NoiseSettings = NO_NOISE,
        full: FullObservation | None = None,
        interval: float = 0.01,
        largest_change: float = 1.0,
    ) -> None:
        """full: None: the task observes. interval: between observations [s].

        largest_change: of a commanded pressure in that time, normalised.
        """
        self._task = task
        self._perception = Perception()
        if noise.of_observations:
            self._perception = NoisyPerception(noise, interval, count)
        observed = task if full is None else full
        self.low, self.high = observed.low, observed.high
        """(M,) bounds of an observation."""
        # compared as 64-bit floats, so that clipping converts only once
        self._low, self._high = self.low.astype(np.float64), self.high.astype(np.float64)
        self.space = spaces.Box(self.low, self.high, self.low.shape, np.float32)
        """Space of the observation of one episode."""
        self.size = self.high.size
        """M, the size of an observation."""
        self.is_ball_play = (
            full is None
            and not noise.of_observations
            and observes_as_published(task)
            and bool(np.all(self.low < self.high))
        )
        """Whether observations are exactly the numbers of `observations`, within bounds: then
        `begin` and `observe` need not be called."""
        self._full: FullObserver | None = None
        if full is not None:
            self._full = FullObserver(full, noise, interval, largest_change, count)

    def look_through(self, perception: Perception) -> None:
        """Sets the source of ball and pressures from the next episode on."""
        self._perception = perception

    def begin(
        self, state: State, generators: Sequence[np.random.Generator], which: IntArray
    ) -> Float32Array:
        """Computes the first observations (n, M) of new episodes `which` (n,).

        `state` and `generators` are of these episodes only; each generator is drawn from once if
        there is any noise.
        """
        seen = self._perception.begin(state, generators, which)
        if self._full is None:
            return self._of_task(state, seen)
        return self.clip(self._full.begin(state, seen, which))

    def observe(self, state: State, which: IntArray | slice = EVERY) -> Float32Array:
        """Computes the observations (n, M) after a step of episodes `which` (n,) to this state."""
        seen = self._perception.perceive(state, which)
        if self._full is None:
            return self._of_task(state, seen)
        return self.clip(self._full.observe(state, seen, which))

    def clip(self, observations: FloatArray) -> Float32Array:
        """Clamps observations (..., M) to the bounds; a fresh array."""
        within = np.minimum(np.maximum(observations, self._low), self._high)
        return within.astype(np.float32)

    def _of_task(self, state: State, seen: Perceived) -> Float32Array:
        if seen.ball is not state.ball or seen.pressures is not state.pressures:
            state = replace(state, ball=seen.ball, pressures=seen.pressures)
        return self.clip(self._task.observe(state))
