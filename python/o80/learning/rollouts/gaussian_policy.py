"""A policy with NumPy alone: a network computes the mean of the actions, and noise is added."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from o80.base.arrays import Float32Array
from o80.base.errors import InvalidArgument


@dataclass(frozen=True, eq=False)
class GaussianPolicy:
    """Observations (N, M) => actions (N, A), drawn from normal distributions.

    Observations are normalised, then go through fully connected layers with tanh between them; the
    last layer gives the means of the actions. The actions are not clipped.
    """

    mean: Float32Array  #: (M,) subtracted from the observations
    scale: Float32Array  #: (M,) factor of the observations after that
    weights: tuple[Float32Array, ...]  #: weights of each layer (out, in)
    biases: tuple[Float32Array, ...]  #: biases of each layer (out,)
    log_std: Float32Array  #: (A,) logarithm of the standard deviation of each action
    clip: float = 10.0  #: normalised observations are clipped into plus or minus this

    def __post_init__(self) -> None:
        sizes = [len(self.mean), *(len(bias) for bias in self.biases)]
        expected = {"scale": (sizes[0],), "log_std": (sizes[-1],)}
        for name, shape in expected.items():
            if getattr(self, name).shape != shape:
                raise InvalidArgument(
                    f"{name} must have shape {shape}, got {getattr(self, name).shape}"
                )
        wanted = [(after, before) for before, after in pairwise(sizes)]
        shapes = [weight.shape for weight in self.weights]
        if not wanted or shapes != wanted:
            raise InvalidArgument(f"weights must have the shapes {wanted}, got {shapes}")

    @classmethod
    def new(
        cls,
        inputs: int,
        outputs: int,
        *,
        hidden: tuple[int, ...] = (64, 64),
        log_std: float = 0.0,
        seed: int = 0,
    ) -> "GaussianPolicy":
        """Makes an untrained policy: random weights, and means of 0."""
        generator = np.random.default_rng(seed)
        sizes = [inputs, *hidden, outputs]
        weights = [
            (generator.standard_normal((after, before)) / math.sqrt(before)).astype(np.float32)
            for before, after in pairwise(sizes)
        ]
        weights[-1] = np.zeros_like(weights[-1])
        return cls(
            np.zeros(inputs, np.float32),
            np.ones(inputs, np.float32),
            tuple(weights),
            tuple(np.zeros(size, np.float32) for size in sizes[1:]),
            np.full(outputs, log_std, np.float32),
        )

    def means(self, observations: NDArray[np.floating]) -> Float32Array:
        """Computes the means of the actions (N, A)."""
        seen = (np.asarray(observations, np.float32) - self.mean) * self.scale
        hidden: Float32Array = np.clip(seen, -self.clip, self.clip)
        last = len(self.weights) - 1
        for layer, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            hidden = hidden @ weight.T + bias
            if layer < last:
                hidden = np.tanh(hidden)
        return hidden

    def sample(
        self, observations: NDArray[np.floating], generator: np.random.Generator
    ) -> tuple[Float32Array, NDArray[np.float64]]:
        """Draws actions (N, A); returns the logarithms of their densities (N,) too."""
        means = self.means(observations)
        noise = generator.standard_normal(means.shape, np.float32)
        log_std = self.log_std.astype(np.float64)
        logarithms = (
            -0.5 * np.square(noise, dtype=np.float64).sum(axis=1)
            - log_std.sum()
            - 0.5 * len(log_std) * math.log(2 * math.pi)
        )
        actions = means + np.exp(self.log_std) * noise
        return actions.astype(np.float32, copy=False), logarithms
