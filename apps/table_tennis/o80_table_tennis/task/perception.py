"""Observed ball and pressures: noisy, delayed, with missed frames.

Each episode has its own generator of noise, so that one environment and a copy among many
observe the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from o80.base.arrays import FloatArray, IntArray

from ..world.arm import MUSCLES
from ..world.ball import GRAVITY
from .noise import NoiseSettings
from .state import State

BLOCK = 128
"""Number of observations whose noise is drawn at once."""
BALL = 6
"""Size of a ball: position, velocity."""
SEEDS = 2**63
EVERY = slice(None)


@dataclass(slots=True)
class Perceived:
    """Perception of N episodes."""

    ball: FloatArray
    """(N, 6) position [m] and velocity [m/s]; the last ones while the ball is not seen"""
    missed: NDArray[np.bool_]
    """(N,) whether the ball was not seen"""
    pressures: FloatArray
    """(N, 8) normalised"""
    first: bool = False
    """Whether this is the first sighting in the episode, after a guess."""


class Perception:
    """Source of observed ball and pressures; this one returns the true values."""

    def begin(
        self, state: State, generators: Sequence[np.random.Generator], which: IntArray
    ) -> Perceived:
        """Returns the first perception of new episodes `which` (n,) in this state."""
        return self.perceive(state, which)

    def perceive(self, state: State, which: IntArray | slice = EVERY) -> Perceived:
        """Returns the perception after a step of some of the N episodes."""
        return Perceived(state.ball, np.zeros(len(state.ball), np.bool_), state.pressures)


class NoisyPerception(Perception):
    """Perception of N episodes (`count`) with noise.

    `interval`: time between observations [s].
    """

    def __init__(self, noise: NoiseSettings, interval: float, count: int) -> None:
        self._noise, self._interval = noise, interval
        self._sigmas = np.array(
            [noise.ball_position] * 3 + [noise.ball_velocity] * 3 + [noise.pressure] * MUSCLES
        )
        self._generators: list[np.random.Generator] = [np.random.default_rng(0)] * count
        self._normal = np.zeros((count, BLOCK, BALL + MUSCLES))
        self._missed = np.zeros((count, BLOCK), np.bool_)
        self._at = np.zeros(count, np.int64)
        self._every = np.arange(count)
        self._last = np.zeros((count, BALL))
        self._delay = Delay(noise.latency, interval, count) if noise.latency else None

    def begin(
        self, state: State, generators: Sequence[np.random.Generator], which: IntArray
    ) -> Perceived:
        """Draws the seed of each episode's noise from its generator."""
        for copy, generator in zip(which.tolist(), generators, strict=True):
            self._generators[copy] = np.random.default_rng(int(generator.integers(SEEDS)))
            self._draw(copy)
            self._missed[copy, 0] = False  # an episode begins with a sighting
        self._at[which] = 0
        if self._delay is not None:
            self._delay.begin(state.ball, which)
        return self._perceived(state, which)

    def perceive(self, state: State, which: IntArray | slice = EVERY) -> Perceived:
        """Returns the perception with the next noise."""
        if self._delay is not None:
            self._delay.add(state.ball, which)
        chosen = self._every[which]
        at = (self._at[chosen] + 1) % BLOCK
        self._at[chosen] = at
        for copy in chosen[at == 0].tolist():
            self._draw(copy)
        return self._perceived(state, chosen)

    def _perceived(self, state: State, which: IntArray) -> Perceived:
        at = self._at[which]
        ball = state.ball if self._delay is None else self._delay.delayed(which)
        noise, missed = self._normal[which, at], self._missed[which, at]
        ball = np.where(missed[:, None], self._last[which], ball + noise[:, :BALL])
        self._last[which] = ball
        return Perceived(ball, missed, state.pressures + noise[:, BALL:])

    def _draw(self, copy: int) -> None:
        """Draws the noise of an episode's next BLOCK observations."""
        generator = self._generators[copy]
        self._normal[copy] = generator.standard_normal((BLOCK, BALL + MUSCLES)) * self._sigmas
        self._missed[copy] = generator.random(BLOCK) < self._noise.missed_frames


class Delay:
    """Delays the balls of N episodes."""

    def __init__(self, latency: float, interval: float, copies: int) -> None:
        self._late, self._share = int(latency / interval), latency / interval % 1.0
        self._interval = interval
        self._past = np.zeros((copies, self._late + 2, BALL))
        """Balls of the last observations, the newest first."""

    def begin(self, balls: FloatArray, which: IntArray) -> None:
        """Begins episodes with balls (n, 6); extrapolates their flights backwards."""
        ago = self._interval * np.arange(self._late + 2)[:, None]
        states = np.repeat(balls[:, None], self._late + 2, axis=1)
        states[..., :3] -= ago * states[..., 3:]
        states[..., 2:3] -= 0.5 * GRAVITY * ago**2
        states[..., 5:6] += GRAVITY * ago
        self._past[which] = states

    def add(self, balls: FloatArray, which: IntArray | slice) -> None:
        """Adds the next balls (n, 6)."""
        self._past[which, 1:] = self._past[which, :-1].copy()
        self._past[which, 0] = balls

    def delayed(self, which: IntArray) -> FloatArray:
        """Interpolates delayed balls (n, 6) by cubics through positions and velocities."""
        new, old = self._past[which, self._late], self._past[which, self._late + 1]
        back, forth = self._share, 1.0 - self._share
        rise = (new[:, :3] - old[:, :3]) / self._interval
        bend = new[:, 3:] + old[:, 3:] - 2 * rise
        lean = rise - old[:, 3:] - bend
        way = forth * self._interval * (old[:, 3:] + forth * (lean + forth * bend))
        return np.hstack([old[:, :3] + way, back * old[:, 3:] + forth * new[:, 3:]])
