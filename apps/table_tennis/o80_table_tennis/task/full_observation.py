"""The observation `full`: a Markov state also with dead time and noise.

Contains the arm, the pressures, recent commands that have not acted yet, and an estimate of
the ball with its spin and its predicted crossing of the racket's plane. All
numbers are scaled to about -1 to 1.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from o80.base.arrays import Float32Array, FloatArray

from ..world.arm import MUSCLES


class Part(NamedTuple):
    """Part of the observation: (number - centre) / scale, clamped to plus or minus `bound`."""

    name: str
    centres: tuple[float, ...]
    scale: tuple[float, ...]
    bound: float


@dataclass(frozen=True)
class FullObservation:
    """Content and scaling of `full`; `parts` lists all numbers in order."""

    changes: int = 4
    """Number of recent changes of the commanded pressures: with steps of 10 ms, they cover
    the real arm's longest dead time, 40 ms."""
    plane: float = 0.3
    """y of the plane whose crossing by the ball is predicted [m]; the racket reaches 0.7 m."""
    joint_position: float = 1.75
    """[rad]"""
    joint_velocity: float = 10.0
    """[rad/s]"""
    ball_velocity: float = 5.0
    """[m/s]"""
    spin: float = 100.0
    """[rad/s]"""

    def parts(self) -> Iterator[Part]:
        """Yields all parts in order."""
        velocity = (self.ball_velocity,) * 3
        yield _alike("joint_positions", 4, self.joint_position, 1.0)
        yield _alike("joint_velocities", 4, self.joint_velocity, 4.0)
        yield Part("pressures", (0.5,) * MUSCLES, (0.5,) * MUSCLES, 1.5)
        yield Part("asked", (0.5,) * MUSCLES, (0.5,) * MUSCLES, 1.0)
        yield _alike("changes", self.changes * MUSCLES, 1.0, 1.0)
        yield Part("racket", (0.3, 0.3, 1.1), (0.5,) * 3, 3.0)
        yield Part("time", (0.5,), (0.5,), 20.0)
        yield Part("ball_position", (0.4, 1.5, 1.0), (0.5, 1.5, 0.5), 6.0)
        yield Part("ball_velocity", (0.0,) * 3, velocity, 4.0)
        yield _alike("spin", 1, self.spin, 4.0)
        yield Part("crossing_position", (0.4, 1.0), (0.4, 0.4), 5.0)
        yield Part("crossing_velocity", (0.0,) * 3, velocity, 4.0)
        yield Part("crossing_time", (0.4,), (0.4,), 4.0)

    @property
    def high(self) -> Float32Array:
        """Largest observation (M,), a fresh array."""
        bounds = [part.bound for part in self.parts() for _ in part.centres]
        return np.array(bounds, dtype=np.float32)

    @property
    def low(self) -> Float32Array:
        """Least observation (M,), a fresh array."""
        return -self.high

    @property
    def centres(self) -> FloatArray:
        """Centres (M,), a fresh array."""
        return np.array([centre for part in self.parts() for centre in part.centres])

    @property
    def scales(self) -> FloatArray:
        """Scales (M,), a fresh array."""
        return np.array([scale for part in self.parts() for scale in part.scale])

    def places(self) -> dict[str, slice]:
        """Returns the slice of each part by name."""
        places, at = {}, 0
        for part in self.parts():
            places[part.name] = slice(at, at + len(part.centres))
            at += len(part.centres)
        return places


def full_observation(observation: str | FullObservation) -> FullObservation | None:
    """Returns the observation of a name, or the object itself; None: the task observes.

    Raises ValueError or TypeError for other values.
    """
    if isinstance(observation, FullObservation):
        return observation
    unknown: object = observation
    if not isinstance(unknown, str):
        raise TypeError(
            f"observation must be one of published, full, or a FullObservation: {unknown!r}"
        )
    if observation not in ("published", "full"):
        raise ValueError(f"unknown observation '{observation}'; there are: published, full")
    return FullObservation() if observation == "full" else None


def _alike(name: str, count: int, scale: float, bound: float) -> Part:
    return Part(name, (0.0,) * count, (scale,) * count, bound)
