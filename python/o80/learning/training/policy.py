"""A learned policy that needs only NumPy: a network (.npz), and its task (.json)."""

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from o80.base.errors import InvalidArgument
from o80.base.finite import json_text
from o80.learning.rollouts import GaussianPolicy
from o80.learning.training.tasks import NamedTask, spread

POLICY = "policy.npz"
"""Policy file in the folder of a training."""
_FORMAT = 1


@dataclass(frozen=True, eq=False)
class LearnedPolicy:
    """Observations (..., M) => actions (..., A) of the action space."""

    network: GaussianPolicy
    """Its means are the actions, in [-1, 1]."""
    action_space: Box
    """(A,) limits and type of the actions."""
    task: NamedTask
    """The task of its training."""
    training: Mapping[str, Any] = field(default_factory=dict)
    """Facts about the training (seed, copies, decisions, episodes), for people."""

    def act(self, observations: NDArray[Any]) -> NDArray[Any]:
        """Returns the actions (..., A) for observations (..., M), without exploration."""
        actions: NDArray[Any] = spread(self.network.means(observations), self.action_space)
        return actions

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes `path`.npz and `path`.json, each atomically."""
        stem, network, space = _stem(path), self.network, self.action_space
        arrays: dict[str, Any] = {name: getattr(network, name) for name in _ARRAYS}
        arrays |= {"low": space.low, "high": space.high, "clip": np.array(network.clip)}
        for layer, (weight, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
            arrays |= {f"weight_{layer}": weight, f"bias_{layer}": bias}
        new = stem.with_name(f"{stem.name}.new.npz")
        np.savez(new, **arrays)
        os.replace(new, _file(stem, ".npz"))
        told = {"format": _FORMAT, "task": asdict(self.task), "training": dict(self.training)}
        new.write_text(json_text(told, indent=2) + "\n")
        os.replace(new, _file(stem, ".json"))

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> "LearnedPolicy":
        """Loads both files; `path` names one of them, or the folder of a training.

        Raises InvalidArgument for missing or damaged files.
        """
        stem = _stem(path)
        for suffix in (".npz", ".json"):
            if not _file(stem, suffix).is_file():
                raise InvalidArgument(
                    f"{_file(stem, suffix)}: no such file; a learned policy is a file .npz and one "
                    ".json beside it, as `python -m o80.learning train` writes them"
                )
        try:
            told = json.loads(_file(stem, ".json").read_text())
            if told["format"] != _FORMAT:
                raise ValueError(f"format {told['format']} is not {_FORMAT}")
            with np.load(_file(stem, ".npz"), allow_pickle=False) as file:
                arrays = dict(file)
            if not all(np.isfinite(array).all() for array in arrays.values()):
                raise ValueError("a network must hold finite numbers only")
            layers = range(sum(name.startswith("weight_") for name in arrays))
            network = GaussianPolicy(
                weights=tuple(arrays[f"weight_{layer}"] for layer in layers),
                biases=tuple(arrays[f"bias_{layer}"] for layer in layers),
                clip=float(arrays["clip"]),
                **{name: arrays[name] for name in _ARRAYS},
            )
            low, high = arrays["low"], arrays["high"]
            space = Box(low, high, dtype=low.dtype.type)
            return cls(network, space, NamedTask(**told["task"]), told["training"])
        except (LookupError, TypeError, ValueError, OSError) as error:
            raise InvalidArgument(f"{stem}: not a policy of this version: {error}") from error


_ARRAYS = ("mean", "scale", "log_std")


def _stem(path: str | os.PathLike[str]) -> Path:
    given = Path(path)
    if given.is_dir():
        given = given / POLICY
    return given.with_suffix("") if given.suffix in (".npz", ".json") else given


def _file(stem: Path, suffix: str) -> Path:
    return stem.with_name(stem.name + suffix)
