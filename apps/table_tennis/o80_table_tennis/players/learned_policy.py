"""A learned policy, played with NumPy alone: a network (.npz), and what it plays with (.json)."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from o80.base.arrays import Float32Array

from .conditions import Conditions
from .network import Network

FORMAT = 1
SHIPPED = Path(__file__).with_name("learned")
"""The policy that comes with this package, `learned.npz` and `learned.json`."""


@dataclass
class LearnedPolicy:
    """Plays in an environment of `conditions`: `conditions.rig()` and `conditions.task()`."""

    network: Network
    conditions: Conditions
    training: Mapping[str, Any] = field(default_factory=dict)
    """How it was learned: for people."""

    def reset(self) -> None:
        """Every action follows from one observation."""

    def act(self, observation: Float32Array) -> Float32Array:
        """The action (8,)."""
        return self.network.act(observation)

    def save(self, path: Path) -> None:
        """Writes `path`.npz and `path`.json."""
        arrays: dict[str, Any] = dict(self.network.arrays())
        np.savez(path.with_suffix(".npz"), **arrays)
        told = {
            "format": FORMAT,
            "conditions": self.conditions.as_json(),
            "training": dict(self.training),
        }
        path.with_suffix(".json").write_text(json.dumps(told, indent=2) + "\n")

    @classmethod
    def load(cls, path: Path) -> LearnedPolicy:
        """Loads `path`.npz and `path`.json; `path` may name either of them.

        Raises FileNotFoundError or ValueError.
        """
        for suffix in (".npz", ".json"):
            if not path.with_suffix(suffix).is_file():
                raise FileNotFoundError(
                    f"{path.with_suffix(suffix)}: no such file; a learned policy is a file .npz "
                    "and one .json beside it, as `python -m o80_table_tennis.train` writes them"
                )
        try:
            told = json.loads(path.with_suffix(".json").read_text())
            if told["format"] != FORMAT:
                raise ValueError(f"format {told['format']} is not {FORMAT}")
            with np.load(path.with_suffix(".npz"), allow_pickle=False) as arrays:
                network = Network.of_arrays(arrays)
            return cls(network, Conditions.of_json(told["conditions"]), told["training"])
        except (KeyError, TypeError, ValueError, OSError) as error:
            raise ValueError(f"{path}: not a learned policy of this version: {error}") from error


def shipped_policy() -> LearnedPolicy:
    """The policy that comes with this package."""
    return LearnedPolicy.load(SHIPPED)
