"""A policy that learned on the twin plays the arm."""

from dataclasses import replace
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import o80
from o80_arms import fakes

EXAMPLE = Path(__file__).parents[3] / "examples" / "python" / "twin_to_arm.py"


@pytest.fixture
def example() -> Any:
    """The example as a module."""
    spec = spec_from_file_location(EXAMPLE.stem, EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def both(example: Any, play: Any) -> list[Any]:
    """Results of `play` with the twin and with the arm, in bursts."""
    with fakes.so101(tick=1 / example.RATE) as fake:
        every = {"so101_twin": {}, "so101": fake.options}.items()
        given = []
        for name, options in every:
            with example.running(name, options, bursting=True) as arm:
                given.append(play(arm))
        return given


def test_the_policy_of_the_example_reaches_its_goals_on_both(package: Path, example: Any) -> None:
    random = np.random.default_rng(2)
    twin = o80.robots.load("so101_twin")
    tip = example.Tip(twin)
    seen, answers = example.demonstrations(twin, tip, random, motions=800)
    policy = example.Policy.fitted(seen, answers, random)
    goals = random.uniform(example.LOW, example.HIGH, (8, 3))
    apart = both(example, lambda arm: example.play(arm, policy, goals, tip))
    assert (np.array(apart) < example.NEAR).all(), apart
    untaught = replace(policy, outer=0 * policy.outer)
    apart = both(example, lambda arm: example.play(arm, untaught, goals, tip))
    assert (np.array(apart) > example.NEAR).all(), apart


def test_the_same_answers_are_the_same_motion_on_both_bit_for_bit(
    package: Path, example: Any
) -> None:
    """A policy whose answers depend on the goal alone."""
    tip = example.Tip(o80.robots.load("so101_twin"))
    goals = np.random.default_rng(3).uniform(example.LOW, example.HIGH, (6, 3))

    def policy(joints: Any, goal: Any) -> Any:
        begin, end = np.array(example.HOME[:4]), np.array([*(4 * goal), 0.5])
        return np.linspace(begin, end, example.ROWS)

    def desired(arm: o80.Frontend) -> bytes:
        arm.add_command(None, example.HOME, duration=2.0)
        arm.pulse_and_wait()  # both stand in the same place
        example.play(arm, policy, goals, tip)
        return bytes(arm.history(len(goals) * example.TRY).rows["desired"].tobytes())

    of_twin, of_arm = both(example, desired)
    assert of_twin == of_arm
