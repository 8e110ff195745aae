"""A policy that takes 30 ms to answer: single actions beside action chunks, in real time.

Every way plays the same balls, a few at a time in turn, so that all meet the same load of the
machine. With `--busy` two busy loops run beside them for each processor. Prints a table.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from o80.base.arrays import Float32Array
from o80_table_tennis.environment import TableTennisEnvironment
from o80_table_tennis.players.found_parameters import found_settings
from o80_table_tennis.players.hitting_policy import HittingPolicy
from o80_table_tennis.players.policies import DEFAULT_FACTOR, Policy
from o80_table_tennis.players.rolled_out_policy import RolledOutPolicy
from o80_table_tennis.playing import play
from o80_table_tennis.report.statistics import Played
from o80_table_tennis.rig.arm_numbers import ArmNumbers
from o80_table_tennis.settings import Pacing, RigSettings, TaskSettings
from o80_table_tennis.world.arm import MUSCLES
from o80_table_tennis.world.table import TARGET
from o80_table_tennis.world.timing import PERIOD, STEP

LATE_STEPS = 3
LATE = LATE_STEPS * STEP
"""How long an answer takes [s]."""
CHUNKS = TaskSettings(factor=DEFAULT_FACTOR, fly_out=True, chunk_size=10, action_steps=5, delay=16)
LONGER = replace(CHUNKS, chunk_size=13, action_steps=8)
SINGLE = TaskSettings(
    factor=DEFAULT_FACTOR, fly_out=True, max_late=CHUNKS.max_late + CHUNKS.planned
)
"""Given up as stalled as late as both of them."""
AT_A_TIME = 5
"""Balls that a way plays before the next one's turn."""


@dataclass
class Slow:
    """Thinks for `LATE`, the time of the policy's own computation included."""

    policy: Policy

    def reset(self) -> None:
        self.policy.reset()

    def act(self, observation: Float32Array) -> NDArray[np.float32]:
        end = time.monotonic() + LATE
        action = self.policy.act(observation)
        time.sleep(max(0.0, end - time.monotonic()))
        return action


@dataclass
class Delayed:
    """Answers every 10 ms, but to what it saw `LATE` before: a long line to a fast policy."""

    policy: Policy
    underway: deque[NDArray[np.float32]] = field(default_factory=deque)

    def reset(self) -> None:
        self.policy.reset()
        self.underway = deque([np.zeros(MUSCLES, np.float32)] * LATE_STEPS)

    def act(self, observation: Float32Array) -> NDArray[np.float32]:
        self.underway.append(self.policy.act(observation))
        return self.underway.popleft()


Way = tuple[Callable[[], Policy], TaskSettings]


def ways(rig: RigSettings) -> Mapping[str, Way]:
    """By name: policy and task."""
    real_time = rig.pacing.real_time
    settings = found_settings().for_arm(ArmNumbers.of_rig(rig))
    told = replace(settings, dead_time=tuple(each + LATE for each in settings.dead_time))
    blocking: Callable[[Policy], Policy] = Slow if real_time else lambda policy: policy
    found: dict[str, Way] = {
        "single actions, no delay": (lambda: HittingPolicy(settings), SINGLE),
        "single actions, thinks for 30 ms": (lambda: Slow(HittingPolicy(settings)), SINGLE),
        "single actions, acting 30 ms late": (lambda: Delayed(HittingPolicy(settings)), SINGLE),
        "the same, policy told of the delay": (lambda: Delayed(HittingPolicy(told)), SINGLE),
        "chunks, thinks for 30 ms every 50 ms": (
            lambda: blocking(RolledOutPolicy(settings, CHUNKS)),
            CHUNKS,
        ),
        "chunks, thinks for 30 ms every 80 ms": (
            lambda: blocking(RolledOutPolicy(settings, LONGER)),
            LONGER,
        ),
    }
    if not real_time:
        del found["single actions, thinks for 30 ms"]
    return found


@contextmanager
def busy(loops: int) -> Iterator[None]:
    """So many processes beside that never rest."""
    processes = [multiprocessing.Process(target=_loop, daemon=True) for _ in range(loops)]
    for each in processes:
        each.start()
    try:
        yield
    finally:
        for each in processes:
            each.kill()
            each.join()


def _loop() -> None:
    while True:
        pass


def row(name: str, played: list[Played], load: float) -> str:
    """A row of the table."""
    episodes = [episode for each in played for episode in each.episodes]
    misses = [
        float(np.hypot(each.landing[0] - TARGET[0], each.landing[1] - TARGET[1]))
        for each in episodes
        if each.returned and each.landing is not None
    ]

    def total(count: str) -> int:
        return sum(int(getattr(each.statistics, count)) for each in played)

    median = f"{np.median(misses):.2f} m" if misses else ""
    touched, returned = (sum(each.touches for each in played), sum(each.returns for each in played))
    starved = 1000 * total("starved_iterations") * PERIOD
    return (
        f"| {name} | {touched} | {returned} | {median} | {total('late_actions')} of "
        f"{total('steps')} | {starved:.0f} ms | {total('stalled_episodes')} | {load:.1f} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--balls", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--busy", action="store_true", help="two busy loops for each processor")
    parser.add_argument(
        "--simulated-time", action="store_true", help="accelerated: no answer takes any time"
    )
    parser.add_argument("--preset", default="standard", help="of the arm")
    asked = parser.parse_args()
    pacing = Pacing.INLINE if asked.simulated_time else Pacing.REAL_TIME
    rig = RigSettings(preset=asked.preset, pacing=pacing)
    compared = ways(rig)
    played: dict[str, list[Played]] = {name: [] for name in compared}
    loads: dict[str, list[float]] = {name: [] for name in compared}
    with busy(2 * len(os.sched_getaffinity(0)) if asked.busy else 0):
        for first in range(0, asked.balls, AT_A_TIME):
            for name, (make, task) in compared.items():
                balls = range(first, min(first + AT_A_TIME, asked.balls))
                with TableTennisEnvironment(rig=rig, task=task) as environment:
                    played[name].append(play(environment, make(), balls, seed=asked.seed))
                loads[name].append(os.getloadavg()[0])
    print(f"{asked.balls} balls")
    print("| way | touched | returned | median miss | late | starved | stalled | load |")
    print("|---|---|---|---|---|---|---|---|")
    for name, parts in played.items():
        print(row(name, parts, float(np.mean(loads[name]))))


if __name__ == "__main__":
    main()
