"""Learning to return balls: the task for `python -m o80.learning train`, and evaluations.

`ours.json` and `published.json` are settings of trainings.
"""

from __future__ import annotations

from typing import Any

from ..copies import TableTennisCopies
from ..players.conditions import Conditions


def play(
    copies: int, *, ball_seed: int = 0, threads: int | None = 1, **conditions: Any
) -> TableTennisCopies:
    """Makes the task of `Conditions`, given as keywords, for the trainer of o80.learning."""
    its = Conditions(**conditions)
    task = its.task(ball_seed=ball_seed)
    return TableTennisCopies(copies, rig=its.rig(), task=task, threads=threads)
