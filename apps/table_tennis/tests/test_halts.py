"""A halt ends an episode by name, and the next reset resumes the arm."""

from opened_environment import STILL, opened

import o80


def test_an_arm_that_was_halted_ends_its_episode_as_halted() -> None:
    with opened() as environment:
        environment.reset(seed=1)
        environment.step(STILL)
        o80.halt(environment.arm.segment, "a hand is near")
        _, _, terminated, _, info = environment.step(STILL)
        assert (terminated, info["halt"]) == (True, "a hand is near")
        assert environment.summary.end == info["end_text"] == "halted"
        environment.reset(seed=1)
        assert not environment.step(STILL)[2]
