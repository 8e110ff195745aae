"""The environment by the clock: late actions, which replay, and the way back to the start."""

from contextlib import closing
from pathlib import Path

import numpy as np
from opened_environment import PUSH, WAITING, opened

import o80
from o80_table_tennis.settings import Pacing
from o80_table_tennis.world.arm import MUSCLES


def test_a_run_in_real_time_with_late_actions_and_resets_replays_bit_for_bit(
    tmp_path: Path,
) -> None:
    path, rng, late_steps = tmp_path / "run.mcap", np.random.default_rng(0), (5, 20)
    with opened(Pacing.REAL_TIME, record=path) as environment:
        for episode in range(2):
            environment.reset(seed=episode)
            for step in range(40):
                if step in late_steps:  # sent after the iteration for which the action is meant
                    row = environment.task.single.span[2]
                    environment.arm.wait_for(row + 7, timeout=WAITING)
                environment.step(rng.uniform(-1, 1, MUSCLES).astype(np.float32))
        assert environment.statistics().late_actions >= 2 * len(late_steps)
        published = [environment.arm.published, environment.twins[0].published]

    report = o80.replay(path)
    assert report.identical, report
    arm, twin = report.runs
    assert arm.rows > published[0]
    assert twin.rows == published[1] + 1


def test_a_real_arm_goes_back_to_its_start_by_commands() -> None:
    with closing(opened(Pacing.REAL_TIME)) as environment:
        first, _ = environment.reset(seed=1)
        for _ in range(40):
            environment.step(PUSH)
        moved = environment.arm.published
        again, _ = environment.reset()
        rows = environment.arm.history(since=moved)

        assert not rows.fresh.any()  # no teleport
        assert np.abs(np.diff(rows.extended.joint_positions, axis=0)).max() < 0.05
        np.testing.assert_allclose(again[:4], first[:4], atol=0.06)
