"""Checks the users' arguments, because Gymnasium passes any keyword to the environment."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .settings import Pacing, RigSettings, TaskSettings

OPTIONS = ("ball", "flight")
"""Options of `reset`."""


def refuse_wrong_arguments(
    rig: object, task: object, render_mode: str | None, modes: list[str]
) -> None:
    """Raises TypeError or ValueError for wrong arguments; the text names valid ones."""
    for name, given, wanted in (("rig", rig, RigSettings), ("task", task, TaskSettings)):
        if given is None or isinstance(given, wanted):
            continue
        fields = given.items() if isinstance(given, dict) else ()
        inside = ", ".join(f"{key}={value!r}" for key, value in fields) or "..."
        raise TypeError(
            f"{name} must be a {wanted.__name__}, got {given!r}: write "
            f"{name}={wanted.__module__}.{wanted.__name__}({inside})"
        )
    if render_mode is not None and render_mode not in modes:
        raise ValueError(f"unknown render mode '{render_mode}'; there are: {', '.join(modes)}")


def refuse_wrong_balls(rig: RigSettings, task: TaskSettings) -> None:
    """Raises ValueError if several worlds are combined with `fly_out`."""
    if task.fly_out and (rig.worlds or 1) > 1:
        raise ValueError(
            "fly_out ends an episode at the first touch of the played ball, while the balls of "
            f"other worlds still come in: give fly_out=False, or worlds=1 instead of {rig.worlds}"
        )


def refuse_unless_for_copies(rig: RigSettings, task: TaskSettings) -> None:
    """Raises ValueError for a rig or task that a vector environment does not support."""
    wanted = {"pacing": Pacing.INLINE, "attach": False}
    given = {name: getattr(rig, name) for name in wanted} | {"chunk_size": task.chunk_size}
    for name, value in (wanted | {"chunk_size": None}).items():
        if given[name] != value:
            raise ValueError(
                f"a vector environment needs {name}={value}, got {given[name]}: make it of "
                "single environments instead, with vectorization_mode='sync' or 'async'"
            )


def refuse_wrong_options(options: Mapping[str, Any], *, period: float) -> None:
    """Raises ValueError for wrong options of `reset`. period: of the worlds [s]."""
    unknown = [name for name in options if name not in OPTIONS]
    if unknown:
        raise ValueError(f"unknown options: {', '.join(unknown)}; reset has {', '.join(OPTIONS)}")
    if "flight" in options and not np.isclose(options["flight"].period, period):
        raise ValueError(
            f"a flight in steps of {options['flight'].period} s cannot be played every "
            f"{period} s: resample it"
        )
