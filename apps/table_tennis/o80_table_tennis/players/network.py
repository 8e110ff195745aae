"""A policy network of NumPy: normalised observations go through layers of tanh."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.base.arrays import Float32Array

CLIP = 10.0
"""Normalised observations lie within plus or minus this."""


@dataclass(frozen=True, eq=False)
class Network:
    """Observations (..., M) => actions (..., A) in [-1, 1].

    An observation is masked, normalised, then goes through fully connected layers with tanh between
    them.
    """

    visible: Float32Array
    """(M,) 1 for numbers that are seen, 0 for those that are masked."""
    mean: Float32Array
    """(M,) taken off the observation."""
    scale: Float32Array
    """(M,) then multiplied with it."""
    weights: tuple[Float32Array, ...]
    """Weights of each layer (out, in)."""
    biases: tuple[Float32Array, ...]
    """Biases of each layer (out,)."""

    def __post_init__(self) -> None:
        size = self.inputs
        for name in ("visible", "scale"):
            if getattr(self, name).shape != (size,):
                raise ValueError(f"{name} must have shape ({size},) as mean has")
        for layer, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            if weight.shape != (len(bias), size):
                raise ValueError(
                    f"the weights of layer {layer} must have shape ({len(bias)}, {size}), "
                    f"got {weight.shape}"
                )
            size = len(bias)
        for array in self.arrays().values():
            if not np.isfinite(array).all():
                raise ValueError("a network must hold finite numbers only")

    @property
    def inputs(self) -> int:
        """Numbers of an observation."""
        return len(self.mean)

    def act(self, observation: Float32Array) -> Float32Array:
        """The actions (..., A) after observations (..., M)."""
        seen = (observation * self.visible - self.mean) * self.scale
        hidden = np.minimum(np.maximum(seen, -CLIP), CLIP)
        last = len(self.weights) - 1
        for layer, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            hidden = hidden @ weight.T + bias
            if layer < last:
                hidden = np.tanh(hidden)
        action: Float32Array = np.minimum(np.maximum(hidden, np.float32(-1)), np.float32(1))
        return action

    def arrays(self) -> dict[str, Float32Array]:
        """By name, as a file holds them."""
        arrays = {"visible": self.visible, "mean": self.mean, "scale": self.scale}
        for layer, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            arrays |= {f"weight_{layer}": weight, f"bias_{layer}": bias}
        return arrays

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Network:
        """Network from the arrays of a file. Raises KeyError or ValueError."""
        layers = sum(name.startswith("weight_") for name in arrays)
        taken = {name: np.asarray(values, np.float32) for name, values in arrays.items()}
        return cls(
            taken["visible"],
            taken["mean"],
            taken["scale"],
            tuple(taken[f"weight_{layer}"] for layer in range(layers)),
            tuple(taken[f"bias_{layer}"] for layer in range(layers)),
        )
