"""Halts of arm and twin end an episode, and the next reset resumes them."""

from contextlib import closing
from typing import Any

import numpy as np
import pytest
from opened_environment import ALL_MODES, PATIENT, PUSH, opened
from test_vector_environment import made

import o80
from o80_table_tennis.settings import Pacing, TaskSettings
from o80_table_tennis.task.end import End

STEPS = 4


@pytest.mark.parametrize("part", [0, 1], ids=["arm", "twin"])
@pytest.mark.parametrize("repeat", [1, 3])
def test_a_halt_ends_the_episode_of_its_copy_as_that_of_a_single_one(
    part: int, repeat: int
) -> None:
    task = TaskSettings(factor=PATIENT.factor, repeat=repeat)
    pushes = np.tile(PUSH, (3, 1))
    calm: Any = None
    for halts in (False, True):
        with made(3, "SameStep", task=task) as vector, closing(opened(task=task)) as single:
            copies: Any = vector.task
            alone: Any = single.task
            vector.reset(seed=[4, 5, 6])
            single.reset(seed=5)
            for _ in range(STEPS):
                vector.step(pushes)
                single.step(PUSH)
            if halts:
                copies.robots[part][1].halt("look")
                alone.robots[part].halt("look")
            result, other = vector.step(pushes), single.step(PUSH)
            if not halts:
                calm = result
                continue
            seen, reward, terminated, truncated, infos = result
            assert terminated.tolist() == [False, True, False]
            assert not truncated.any()
            assert infos["final_info"]["halt"][1] == other[4]["halt"] == "look"
            assert infos["final_info"]["end_text"][1] == other[4]["end_text"] == End.HALTED.text
            assert infos["final_obs"][1].tobytes() == other[0].tobytes()
            assert (reward[1], True) == other[1:3]
            assert seen[[0, 2]].tobytes() == calm[0][[0, 2]].tobytes()
            single.reset()
            assert vector.step(pushes)[0][1].tobytes() == single.step(PUSH)[0].tobytes()


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
