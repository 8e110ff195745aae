"""Decisions a second of table tennis against the number of Ray actors that collect them.

Needs `pip install "o80[ray]"`. Each actor has a processor and a vector environment of 16 copies.
Figures say something on four processors or more; `--actors 1 2` measures on fewer all the same.
"""

from __future__ import annotations

import argparse
import os
import time
from statistics import median

import gymnasium
from rich.console import Console
from rich.table import Table

import o80_table_tennis  # noqa: F401 - makes the id known
from o80.extras import needed
from o80.learning.rollouts import GaussianPolicy, RayWorkers

COPIES = 16
LEAST_PROCESSORS = 4


def made() -> gymnasium.vector.VectorEnv:
    return gymnasium.make_vec(
        "o80_table_tennis:o80/TableTennis-v0",
        num_envs=COPIES,
        autoreset_mode="SameStep",
        threads=1,
    )


def decisions_a_second(actors: int, rounds: int, steps: int) -> float:
    """The median over some iterations; each waits for the slowest actor."""
    with RayWorkers(made, workers=actors, seed=1) as workers:
        spaces = workers.spaces
        (inputs,), (outputs,) = spaces.observation.shape or (), spaces.action.shape or ()
        policy = GaussianPolicy.new(inputs, outputs, log_std=-1.0)
        workers.collect(policy, steps=steps)
        seconds = []
        for _ in range(rounds):
            begin = time.perf_counter()
            workers.collect(policy, steps=steps)
            seconds.append(time.perf_counter() - begin)
    return actors * COPIES * steps / median(seconds)


def numbers_of_actors(processors: int) -> list[int]:
    """1, 2, 4, ... and one for each processor."""
    powers = [2**power for power in range(processors.bit_length()) if 2**power < processors]
    return [*powers, processors]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--actors", type=int, nargs="+", help="numbers of actors")
    parser.add_argument("--rounds", type=int, default=7, help="rollouts of each (default: 7)")
    parser.add_argument("--steps", type=int, default=128, help="of each copy in a rollout (128)")
    asked = parser.parse_args()
    processors = len(os.sched_getaffinity(0))
    if not asked.actors and processors < LEAST_PROCESSORS:
        print(
            f"not measured: {processors} processors, {LEAST_PROCESSORS} are needed for figures "
            "that say something; --actors 1 2 measures all the same"
        )
        return
    ray = needed("ray", "ray", "the scaling of rollouts")
    numbers = asked.actors or numbers_of_actors(processors)
    ray.init(num_cpus=max(numbers), include_dashboard=False, log_to_driver=False)
    table = Table("actors", "decisions/s", "share of linear scaling", title="Ray actors")
    first = 0.0
    for actors in numbers:
        rate = decisions_a_second(actors, asked.rounds, asked.steps)
        first = first or rate / actors
        table.add_row(str(actors), f"{rate:.0f}", f"{100 * rate / (actors * first):.0f} %")
    ray.shutdown()
    Console().print(table)


if __name__ == "__main__":
    main()
