"""Halts of arm and twin end an episode, and the next reset resumes them."""

from contextlib import closing

import numpy as np
import pytest
from opened_environment import ALL_MODES, opened

import o80
from o80_table_tennis.settings import Pacing, TaskSettings


@pytest.mark.parametrize("pacing", ALL_MODES)
@pytest.mark.parametrize("chunk_size", [None, 4])
def test_an_operator_who_halts_the_arm_resumes_it(pacing: Pacing, chunk_size: int | None) -> None:
    task = TaskSettings(max_late=1_000_000, chunk_size=chunk_size, action_steps=1)
    with closing(opened(pacing, task=task)) as environment:
        environment.reset(seed=1)
        still = np.zeros(environment.action_space.shape or (), np.float32)
        arm = environment.arm
        environment.step(still)
        o80.halt(arm.segment, "a hand is near")
        terminated = False
        while not terminated:  # by the clock it acts in the next iteration
            _, _, terminated, _, info = environment.step(still)
        assert info["halt"] == "a hand is near"
        assert environment.summary.end == "halted"
        if pacing is not Pacing.INLINE:
            with pytest.raises(o80.CopyFailed, match=r"a hand is near.*o80 resume"):
                environment.reset()
            assert arm.halted is not None
            arm.resume()
        environment.reset(seed=1)
        assert not environment.step(still)[2]
