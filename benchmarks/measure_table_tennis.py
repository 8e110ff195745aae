"""Steps a second of the accelerated table-tennis environment, beside the same without o80."""

import time
from collections.abc import Callable
from contextlib import ExitStack, closing
from typing import Any, SupportsFloat

import gymnasium
import numpy as np
from numpy.typing import NDArray

from o80_table_tennis.balls.sources import balls_from
from o80_table_tennis.entry_points import accelerated_environment
from o80_table_tennis.rig.ball_records import RECORDS
from plain_table_tennis import PlainEnvironment
from sampling import built, rounds, sample, take_priority

EPISODES = 3
MOST_STEPS = 300

Actions = NDArray[np.float32]
Step = Callable[[Any], tuple[Any, SupportsFloat, bool, bool, Any]]


Seen = list[tuple[NDArray[np.float32], SupportsFloat]]


def episode(step: Step, actions: Actions) -> tuple[float, int, Seen]:
    """Time [s], steps, observations and rewards."""
    seen: Seen = []
    begin = time.perf_counter()
    for action in actions:
        observation, reward, terminated, truncated, _ = step(action)
        seen.append((observation, reward))
        if terminated or truncated:
            break
    return time.perf_counter() - begin, len(seen), seen


def same(one: Seen, other: Seen) -> bool:
    """Bit for bit."""
    return len(one) == len(other) and all(
        np.array_equal(a, b) and paid == owed
        for (a, paid), (b, owed) in zip(one, other, strict=True)
    )


def main() -> None:
    take_priority()
    random = np.random.default_rng(1)
    actions = random.uniform(-1, 1, (MOST_STEPS, 8)).astype(np.float32)
    balls = balls_from(None, 0, 0.002)
    flights = [balls.flight(number) for number in range(EPISODES)]
    with ExitStack() as stack:
        inline = stack.enter_context(closing(accelerated_environment()))
        processes = stack.enter_context(closing(accelerated_environment(processes=True)))
        rows = inline.rig.twins[0].frontend.history(1).rows
        record = rows.dtype[RECORDS[0]][RECORDS[1]].base
        library = built() / "lib" / "plain_table_tennis.so"
        plain = stack.enter_context(
            closing(PlainEnvironment(library, record, inline.rig.arm.range))
        )

        environments: dict[str, gymnasium.Env[Any, Any]] = {
            "steps_plain": plain,
            "steps_inline": inline,
            "steps_processes": processes,
        }
        for turn in range(rounds() + 1):
            flight = flights[turn % EPISODES]
            results = {}
            for name, env in environments.items():
                env.reset(seed=1, options={"flight": flight})
                results[name] = episode(env.step, actions)
            # the same experiment, or there is nothing to compare
            for name, (_, _, seen) in results.items():
                if not same(seen, results["steps_plain"][2]):
                    raise RuntimeError(f"{name} saw something else than the plain environment")
            if turn == 0:
                continue  # everybody warms up
            for name, (seconds, steps, _) in results.items():
                sample(name, "steps/s", steps / seconds)


if __name__ == "__main__":
    main()
