"""Numbers of the hitting policy that a search has found, kept in a file beside this module."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from .hitting_policy import HittingSettings

FILE = Path(__file__).with_name("found_parameters.json")


@dataclass(frozen=True)
class FoundParameters:
    """Result of a search, and how to search again."""

    command: str
    parameters: Mapping[str, float]
    """By their dotted names in `HittingSettings`, like "control.damping"."""
    mean_reward: float
    returns: int
    episodes: int

    def save(self, path: Path = FILE) -> None:
        """Writes them as JSON."""
        content = {**vars(self), "parameters": dict(self.parameters)}
        path.write_text(json.dumps(content, indent=2) + "\n")

    @classmethod
    def load(cls, path: Path = FILE) -> FoundParameters:
        """Reads a file that `save` wrote."""
        return cls(**json.loads(path.read_text()))


def with_parameters(settings: HittingSettings, parameters: Mapping[str, float]) -> HittingSettings:
    """The settings with other numbers. Raises KeyError for a name they do not have."""
    for name, value in parameters.items():
        part_name, _, number_name = name.partition(".")
        part: Any = getattr(settings, part_name, None)
        if not isinstance(getattr(part, number_name, None), float):
            raise KeyError(f"the hitting policy has no number '{name}'")
        changed: dict[str, Any] = {part_name: replace(part, **{number_name: value})}
        settings = replace(settings, **changed)
    return settings


def found_settings() -> HittingSettings:
    """The settings with the numbers of the file."""
    return with_parameters(HittingSettings(), FoundParameters.load().parameters)
