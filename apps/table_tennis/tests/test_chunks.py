"""Action chunks: each row acts in its own iterations, however late the policy answers."""

from contextlib import closing
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from opened_environment import opened, played_out

import o80
import o80_table_tennis
from o80.hybrid.single import Single
from o80_table_tennis.report.recorded_episodes import recorded_episodes
from o80_table_tennis.settings import Pacing, TaskSettings
from o80_table_tennis.task.actions import COARSE, changed_pressures
from o80_table_tennis.world.arm import MUSCLES

ANSWERS = 4
CHUNKED = TaskSettings(factor=COARSE, max_late=1_000_000, chunk_size=8, action_steps=4, delay=16)


def chunks(seed: int = 1) -> np.ndarray:
    random = np.random.default_rng(seed)
    return random.uniform(-0.3, 0.3, (ANSWERS, 8, MUSCLES)).astype(np.float32)


@pytest.mark.parametrize(
    ("pacing", "repeat", "observation"),
    [
        (Pacing.INLINE, 1, "published"),
        (Pacing.INLINE, 2, "published"),
        (Pacing.PROCESSES, 1, "full"),
    ],
)
def test_an_answer_in_no_time_moves_the_arm_as_single_actions_do(
    pacing: Pacing, repeat: int, observation: str
) -> None:
    common: dict[str, Any] = {"factor": COARSE, "repeat": repeat, "observation": observation}
    with closing(opened(pacing, task=TaskSettings(**common))) as environment:
        environment.reset(seed=1)
        for action in chunks()[:, :4].reshape(-1, MUSCLES):
            seen, *_ = environment.step(action)
        alone = environment.arm.history(20 * repeat * ANSWERS)
    task = TaskSettings(chunk_size=8, action_steps=4, **common)
    with closing(opened(pacing, task=task)) as environment:
        environment.reset(seed=1)
        for chunk in chunks():
            also_seen, *_ = environment.step(chunk)
        together = environment.arm.history(20 * repeat * ANSWERS)
        statistics = environment.statistics()
    for name in ("iteration", "desired", "observed"):
        np.testing.assert_array_equal(together.rows[name], alone.rows[name])
    if observation == "published":
        np.testing.assert_array_equal(also_seen, seen)
    assert statistics.late_actions == statistics.starved_iterations == 0
    assert statistics.steps == 4 * repeat * ANSWERS


@pytest.mark.parametrize("pacing", [Pacing.INLINE, Pacing.PROCESSES])
@pytest.mark.parametrize(
    ("thought", "late", "starved"),
    [
        ([0, 0, 0, 0], 0, 0),
        ([15, 15, 15, 15], 0, 0),  # 30 ms
        ([20, 16, 20, 16], 0, 4),  # row 0 has begun, and acts for its last iteration
        ([22, 36, 16, 0], 1 + 4, 6),
        ([15, 60, 40, 16], 8 + 4, 24),  # the second answer is too late for all of its rows
    ],
)
def test_rows_act_in_their_iterations_only_and_late_ones_are_counted(
    pacing: Pacing, thought: list[int], late: int, starved: int
) -> None:
    """`thought`: iterations that the arm makes between each observation and its answer."""
    with closing(opened(pacing, task=CHUNKED)) as environment:
        environment.reset(seed=1)
        arm, task, begun = environment.arm, environment.task, environment.arm.published
        length = 20 * ANSWERS + 60
        wanted = np.tile(task.home_of_arm.pressures, (length, 1))
        pressures, now = task.commanded()[0], 0
        for number, (chunk, thinks) in enumerate(zip(chunks(), thought, strict=True)):
            seen = 20 * number
            now = max(now, seen + thinks)
            if begun + now > arm.published:
                arm.burst(begun + now - arm.published)
            environment.step(chunk)
            for row, action in enumerate(chunk):
                pressures = changed_pressures(pressures, action, factor=COARSE)
                acts = max(seen + 16 + 5 * row, now)  # place of the first iteration
                if acts < seen + 16 + 5 * row + 5:
                    wanted[acts:] = task.range.raw(pressures)
                if row == 3:
                    base = pressures
            pressures = base
            now = max(now, seen + 20)
        statistics = environment.statistics()
        made = arm.published - begun
        desired = arm.history(made).desired
    np.testing.assert_array_equal(desired, wanted[:made])
    assert (statistics.late_actions, statistics.starved_iterations) == (late, starved)
    assert statistics.steps == 4 * ANSWERS


def test_a_decision_that_is_told_after_the_last_row_is_waited_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[bool] = []

    def told_later(sent: o80.SentChunk) -> bool:
        asked.append(decided.fget(sent) and len(asked) % 3 == 2)
        return asked[-1]

    with closing(opened(Pacing.PROCESSES, task=CHUNKED)) as environment:
        environment.reset(seed=1)
        decided = vars(o80.SentChunk)["decided"]
        monkeypatch.setattr(o80.SentChunk, "decided", property(told_later))
        for chunk in chunks():
            environment.step(chunk)
        assert asked.count(True) == ANSWERS
        assert len(asked) >= 3 * ANSWERS
        assert environment.statistics().late_actions == 0


def test_an_episode_is_given_up_when_nothing_was_planned_for_too_long(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    task = TaskSettings(chunk_size=8, action_steps=4, delay=16, max_late=20)
    with closing(opened(Pacing.REAL_TIME, task=task)) as environment:
        environment.reset(seed=1)
        # 36 iterations after an observation the last row of the chunk before it is over
        for lateness, stalled in ((36 + 20, False), (36 + 21, True)):
            monkeypatch.setattr(Single, "lateness", lateness)
            assert environment.step(chunks()[0])[-1]["stalled"] is stalled


def test_a_recording_holds_chunks_as_actions(tmp_path: Path) -> None:
    with closing(opened(task=CHUNKED, record=tmp_path / "run.mcap")) as environment:
        environment.reset(seed=1)
        steps = len(played_out(environment, chunks()[0]))
    (episode,) = recorded_episodes(tmp_path / "run.mcap")
    np.testing.assert_array_equal(episode.actions, np.tile(chunks()[0], (steps, 1, 1)))


def test_what_cannot_be_is_refused() -> None:
    with closing(opened(task=CHUNKED)) as environment:
        assert environment.action_space.shape == (8, MUSCLES)
    with pytest.raises(ValueError, match="a vector environment needs chunk_size=None, got 8"):
        gymnasium.make_vec(o80_table_tennis.ACCELERATED, num_envs=2, task=CHUNKED)
