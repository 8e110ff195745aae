"""Where the time of a step of the table-tennis vector environment goes: a table, and
build/bench/vector_parts.json.

The clock is read around each part, so a step takes about 5 % longer than without.
"""

from __future__ import annotations

import argparse
import functools
import json
import time
from collections import defaultdict
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any
from unittest import mock

import numpy as np
from gymnasium.vector import AutoresetMode
from rich.console import Console
from rich.table import Table

from o80.chained_burst import ChainedBurst
from o80.learning import VectorEnvironment
from o80_table_tennis import copies as copies_module
from o80_table_tennis.copies import TableTennisCopies
from o80_table_tennis.entry_points import vector_environment
from o80_table_tennis.rig.group_rig import GroupRig
from o80_table_tennis.settings import RigSettings, TaskSettings
from o80_table_tennis.task.actions import COARSE
from o80_table_tennis.task.noise import NoiseSettings
from o80_table_tennis.world.arm import MUSCLES
from programs import ROOT
from sampling import take_priority

COPIES = (64, 16)
STEPS = 1000
TASKS = {
    "published": TaskSettings(factor=COARSE),
    "full": TaskSettings(
        factor=COARSE, balls="wide", observation="full", noise=NoiseSettings.tracker(), fly_out=True
    ),
}
PARTS: dict[str, tuple[Any, str]] = {
    "step": (VectorEnvironment, "step"),
    "bursts of arms and twins": (ChainedBurst, "run"),
    "pressures of the actions": (copies_module, "changed_pressures"),
    "observations": (TableTennisCopies, "observe"),
    "infos of the task": (TableTennisCopies, "info"),
    "judging ended episodes": (TableTennisCopies, "judge"),
    "final observations and infos": (VectorEnvironment, "_add_finals"),
    "resets": (VectorEnvironment, "_begin"),
    ". drawing balls": (copies_module, "drawn_episode"),
    ". arms and twins": (GroupRig, "reset"),
}


@dataclass
class Times:
    """Of the parts, in one environment."""

    seconds: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    calls: dict[str, int] = field(default_factory=lambda: defaultdict(int))

    def timed(self, part: str, function: Any) -> Any:
        @functools.wraps(function)
        def call(*arguments: Any, **options: Any) -> Any:
            begin = time.perf_counter()
            try:
                return function(*arguments, **options)
            finally:
                self.seconds[part] += time.perf_counter() - begin
                self.calls[part] += 1

        return call


def times_of(copies: int, preset: str, task: str, threads: int) -> Times:
    """Under random actions, after some steps to warm up."""
    times = Times()
    actions = np.random.default_rng(1).uniform(-1, 1, (64, copies, MUSCLES)).astype(np.float32)
    with ExitStack() as stack:
        for part, (owner, name) in PARTS.items():
            timed = times.timed(part, getattr(owner, name))
            stack.enter_context(mock.patch.object(owner, name, timed))
        environment = stack.enter_context(
            vector_environment(
                num_envs=copies,
                threads=threads,
                task=TASKS[task],
                rig=RigSettings(preset=preset),
                autoreset_mode=AutoresetMode.SAME_STEP,
            )
        )
        environment.reset(seed=1)
        for step in range(STEPS + 200):
            if step == 200:
                times.seconds.clear()
                times.calls.clear()
            environment.step(actions[step % 64])
    return times


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--threads", type=int, default=2)
    threads = parser.parse_args().threads
    take_priority()
    table = Table(r"part of a step \[us]; in brackets: calls a step")
    columns = []
    for copies in COPIES:
        for preset, task in (
            ("standard", "published"),
            ("identified", "published"),
            ("identified", "full"),
        ):
            table.add_column(f"{copies} {preset}, {task}", justify="right")
            columns.append((copies, preset, task, times_of(copies, preset, task, threads)))
    for part in PARTS:
        cells = []
        for *_, times in columns:
            calls = times.calls[part] / STEPS
            often = "" if calls == 1 else f" ({calls:.2f})"
            cells.append(f"{1e6 * times.seconds[part] / STEPS:.0f}{often}")
        table.add_row(part, *cells)
    Console(width=150).print(table)
    found = [
        {
            "copies": copies,
            "preset": preset,
            "observation": task,
            "threads": threads,
            "us_per_step": {part: 1e6 * times.seconds[part] / STEPS for part in PARTS},
        }
        for copies, preset, task, times in columns
    ]
    path = ROOT / "build" / "bench" / "vector_parts.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(found, indent=2) + "\n")


if __name__ == "__main__":
    main()
