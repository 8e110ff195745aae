"""Functions by which Gymnasium makes the environments."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from gymnasium.vector import AutoresetMode

from o80.learning import VectorEnvironment

from .arguments import refuse_wrong_arguments
from .copies import TableTennisCopies
from .environment import TableTennisEnvironment
from .settings import Pacing, RigSettings, TaskSettings


def _made(rig: RigSettings | None, pacing: Pacing, rest: dict[str, Any]) -> TableTennisEnvironment:
    """Makes an environment with this pacing. Raises TypeError for wrong types."""
    refuse_wrong_arguments(rig, None, None, [])
    return TableTennisEnvironment(rig=replace(rig or RigSettings(), pacing=pacing), **rest)


def accelerated_environment(
    *, processes: bool = False, rig: RigSettings | None = None, **rest: Any
) -> TableTennisEnvironment:
    """Makes `o80/TableTennis-v0`: inline, or with arm and twins in separate processes."""
    return _made(rig, Pacing.PROCESSES if processes else Pacing.INLINE, rest)


def real_time_environment(*, rig: RigSettings | None = None, **rest: Any) -> TableTennisEnvironment:
    """Makes `o80/TableTennisRealTime-v0`: the arm runs by the clock."""
    return _made(rig, Pacing.REAL_TIME, rest)


def vector_environment(
    *,
    num_envs: int,
    rig: RigSettings | None = None,
    task: TaskSettings | None = None,
    autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
    render_mode: str | None = None,
    **rest: Any,
) -> VectorEnvironment:
    """Makes copies of `o80/TableTennis-v0` in this process, stepped together by C++ threads.

    rest: `threads` and `camera` of `TableTennisCopies`.
    """
    refuse_wrong_arguments(rig, task, render_mode, TableTennisCopies.metadata["render_modes"])
    copies = TableTennisCopies(num_envs, rig=rig, task=task, **rest)
    return VectorEnvironment(copies, autoreset_mode=autoreset_mode, render_mode=render_mode)
