"""The pace `fastest` beside ruckig, a library of time-optimal motion, on random states and limits.

The controller plans in whole iterations: its speed is the difference of two positions, its
acceleration that of two speeds, its jerk that of two accelerations, and each is bounded in every
iteration. Ruckig's motion is continuous. What the speed and acceleration of a sampled motion are
"now" is known within an iteration only, and whether a motion overshoots its target and comes back
may hang on that. So each motion is compared with ruckig's from all states within that doubt.
"""

import math
import subprocess
from collections import Counter
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import ruckig
from numpy.typing import NDArray

CASES = 10_000
FROM_REST = 5_000
SAMPLES = 4  # positions compared of each motion
Trajectories = list[ruckig.Trajectory]


@dataclass(frozen=True)
class Case:
    """Limits and targets, with the iteration as the unit of time."""

    speed: float
    acceleration: float
    jerk: float
    first: float  # target of the motion that is cut
    cut: int  # iterations of it
    second: float


def random_cases(seed: int, count: int) -> list[Case]:
    random = np.random.default_rng(seed)

    def magnitude(low: float, high: float) -> float:
        return float(10.0 ** random.uniform(low, high))

    cases = []
    for _ in range(count):
        speed = magnitude(-3, 0)
        acceleration = speed * magnitude(-2, 0.3)
        jerk = acceleration * magnitude(-1.5, 0.3) if random.random() < 0.7 else math.inf
        first, second = (random.uniform(-1, 1) * magnitude(-2, 1.5) for _ in range(2))
        cases.append(Case(speed, acceleration, jerk, first, int(magnitude(0, 2.5)), second))
    return cases


def played(program: Path, cases: list[Case]) -> list[NDArray[np.float64]]:
    """The positions of each motion to its second target, the three before it first."""
    asked = np.array([list(vars(case).values()) for case in cases], dtype=np.float64)
    output = subprocess.run([program], input=asked.tobytes(), stdout=subprocess.PIPE, check=True)
    numbers = np.frombuffer(output.stdout)
    motions, at = [], 0
    for _ in cases:
        count = int(numbers[at])
        motions.append(numbers[at + 1 : at + 1 + count])
        at += 1 + count
    assert at == len(numbers)
    return motions


def trajectory(case: Case, position: float, speed: float, acceleration: float) -> ruckig.Trajectory:
    state = ruckig.InputParameter(1)
    state.current_position = [position]
    state.current_velocity = [min(max(speed, -case.speed), case.speed)]
    if math.isfinite(case.jerk):
        limit = case.acceleration
        state.current_acceleration = [min(max(acceleration, -limit), limit)]
    state.target_position = [case.second]
    state.max_velocity = [case.speed]
    state.max_acceleration = [case.acceleration]
    state.max_jerk = [case.jerk]
    found = ruckig.Trajectory(1)
    result = ruckig.Ruckig(1).calculate(state, found)
    assert result in (ruckig.Result.Working, ruckig.Result.Finished), (result, case)
    return found


def references(case: Case, motion: NDArray[np.float64]) -> Trajectories:
    """Ruckig's motions from all states that the samples before the cut may mean."""
    before, last, position = motion[:3]
    speed = position - last
    if math.isinf(case.jerk):
        doubts = (-1.0, -0.5, 0.0, 0.5, 1.0)
        return [trajectory(case, position, speed + d * case.acceleration, 0.0) for d in doubts]
    acceleration = speed - (last - before)
    return [
        trajectory(case, position, speed + d * acceleration, acceleration + e * case.jerk)
        for d, e in product((-1.0, -0.5, 0.0, 0.5, 1.0), (-1.0, 0.0, 1.0))
    ]


def distance_from(case: Case, motion: NDArray[np.float64], expected: Trajectories) -> float:
    """The farthest that a position lies from what ruckig covers 1.5 iterations before and after,
    in units of its own largest step."""
    n = len(motion) - 3
    worst = 0.0
    for i in np.unique(np.linspace(1, n, min(n, SAMPLES)).astype(int)):
        there = [
            each.at_time(min(max(i + shift, 0.0), each.duration))[0][0]
            for each in expected
            for shift in (-1.5, 0.0, 1.5)
        ]
        position = motion[2 + i]
        worst = max(worst, min(there) - position, position - max(there))
    return float(worst / np.abs(np.diff(motion)).max(initial=1e-12))


def whole(duration: float) -> int:
    return max(1, math.ceil(duration - 1e-6))


@pytest.mark.timeout(600)
def test_fastest_takes_as_long_as_ruckig_and_goes_the_same_way(build_prefix: Path) -> None:
    cases = random_cases(seed=1, count=CASES)
    motions = played(build_prefix / "bin" / "o80_fastest", cases)
    later: Counter[int] = Counter()
    far = []
    for case, motion in zip(cases, motions, strict=True):
        n = len(motion) - 3
        assert motion[-1] == case.second, case
        expected = references(case, motion)
        durations = [each.duration for each in expected]
        assert n >= whole(min(durations)) - 1, (case, n, durations)
        later[n - whole(max(durations))] += 1
        far.append(distance_from(case, motion, expected))
    print("iterations more than ruckig takes:", sorted(later.items()))
    print("distance [largest step]:", np.quantile(far, [0.5, 0.9, 0.99, 0.999, 1.0]))
    # each change of speed takes whole iterations, which costs up to two
    assert sum(count for more, count in later.items() if more > 1) < 0.02 * CASES
    assert sum(count for more, count in later.items() if more > 2) < 0.001 * CASES
    assert max(later) <= 4
    assert max(far) < 0.75


def test_from_rest_fastest_takes_at_most_three_iterations_more_than_ruckig(
    build_prefix: Path,
) -> None:
    cases = [replace(case, cut=0) for case in random_cases(seed=2, count=FROM_REST)]
    motions = played(build_prefix / "bin" / "o80_fastest", cases)
    later: Counter[int] = Counter()
    far = []
    for case, motion in zip(cases, motions, strict=True):
        assert motion[-1] == case.second, case
        expected = trajectory(case, 0.0, 0.0, 0.0)  # from rest nothing is in doubt
        later[len(motion) - 3 - whole(expected.duration)] += 1
        far.append(distance_from(case, motion, [expected]))
    print("iterations more than ruckig takes from rest:", sorted(later.items()))
    assert min(later) >= 0
    assert max(later) <= 3
    assert max(far) < 0.05
