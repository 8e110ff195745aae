"""``o80 demo push``: a simulated SO-101 pushes a puck that only its simulated world has."""

import sys
from typing import Any

import numpy as np

from o80.cli.demo import chart
from o80.hybrid import make
from o80_arms.push import NEAR, Push

GOALS = 5


def rule(seen: Any) -> Any:
    """Returns actions (n, 2) for observations (n, 9).

    Behind the puck and in line with its goal, the fingers move ahead, more slowly near the goal;
    beside the puck they move back.
    """
    before, aside, far = seen[:, 0] / 15, seen[:, 5] / 15, seen[:, 4] / 10  # [m]
    ahead = np.clip(far / 0.05, 0.1, 1.0)
    ahead = np.where(np.abs(aside) < 0.006, ahead, np.where(before > -0.055, -1.0, 0.0))
    return np.column_stack([ahead, np.clip(-20 * aside, -1.0, 1.0)]).astype(np.float32)


def run() -> None:
    """Plays in real time and plots the way of the puck. An argument: a file that records it."""
    record = sys.argv[1] if len(sys.argv) > 1 else None
    print(
        "A simulated SO-101 runs in real time in its own process; a simulated world in another\n"
        "process copies its motion, and only this world has a puck. A rule of four lines pushes\n"
        f"it to {GOALS} goals.\n# distance of the puck from its goal [m], . {NEAR} m to reach\n"
    )
    reached = 0
    with make(Push, pacing="real_time", record=record, max_steps=250) as environment:
        task: Any = environment.task
        for number in range(GOALS):
            seen, info = environment.reset(seed=number)
            far, over = [], False
            while not over:
                seen, _, terminated, truncated, info = environment.step(rule(seen[None])[0])
                far.append(abs(task.seen(slice(None))[3][0]))
                over = terminated or truncated
            reached += (success := bool(info.get("is_success", False)))
            seconds, near = np.arange(1, len(far) + 1) * 0.02, np.full(len(far), NEAR)
            name = "reached" if success else "missed"
            print("\n".join(chart(name, seconds, near, np.array(far))), flush=True)
    print(f"\n{reached} of {GOALS} goals reached. A policy that has learned reaches more:")
    print("  pip install torch==2.13.0 'o80[stable-baselines3,record]'")
    print("  python -m o80.learning train o80_arms.push:Push --decisions 300000")
