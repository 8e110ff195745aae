"""The lab in lock-step: the policy sees the ball of the tracker, and every run is the same."""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import o80
from o80_table_tennis.lab.bursting import tracked_environment
from o80_table_tennis.lab.comparison import compare, write
from o80_table_tennis.lab.parts import LabSettings
from o80_table_tennis.lab.report import BURSTING, REPORT
from o80_table_tennis.settings import Pacing, RigSettings, TaskSettings

RIG = RigSettings(preset="identified")
TASK = TaskSettings(balls="wide", observation="full")
STILL = np.zeros(8, np.float32)


def observed(pacing: Pacing, steps: int) -> NDArray[np.float32]:
    """(steps, M) observations of a ball, then as many of the next one."""
    found = []
    with tracked_environment(RIG.paced(pacing), TASK) as (environment, _):
        for ball in (3, 4):
            observation, _ = environment.reset(seed=ball, options={"ball": ball})
            for _ in range(steps):
                found.append(observation.copy())
                observation, *_ = environment.step(STILL)
    return np.array(found)


def test_observations_do_not_depend_on_the_pace() -> None:
    inline = observed(Pacing.INLINE, 12)
    assert np.array_equal(inline, observed(Pacing.PROCESSES, 12))
    assert not [each for each in o80.segments() if each.name.startswith(("cameras", "tracker"))]


def test_a_ball_that_is_put_somewhere_else_is_seen_there() -> None:
    with tracked_environment(RIG, TASK) as (environment, tracking):
        for ball in range(3):
            environment.reset(seed=ball, options={"ball": ball})
            for step in range(14):
                environment.step(STILL)
                assert (len(tracking.first_seen) == ball) == (step < 3) or step < 6
            assert len(tracking.first_seen) == ball + 1
    # 25 ms of latency, and the images that it takes to know a velocity
    assert 0.025 < min(tracking.first_seen) <= max(tracking.first_seen) < 0.1
    assert len(tracking.errors) > 3 * 5
    assert max(tracking.errors) < 0.01


def test_an_arm_with_a_clock_of_its_own_is_refused() -> None:
    real_time = RIG.paced(Pacing.REAL_TIME)
    with (
        pytest.raises(ValueError, match="choose Pacing"),
        tracked_environment(real_time, TASK),
    ):
        pass


@pytest.mark.check
def test_the_tracked_ball_is_returned_nearly_as_often_as_the_true_one(tmp_path: Path) -> None:
    (tmp_path / REPORT).write_text(json.dumps({"balls": {"played": 2}}))
    comparison = compare(LabSettings(balls=10, seed=4))
    write(comparison, tmp_path)
    report = json.loads((tmp_path / REPORT).read_text())
    assert report["balls"] == {"played": 2}
    found = report[BURSTING]
    assert found["returned_true"] >= 6
    assert found["returned_tracked"] >= found["returned_true"] - 2
    assert found["observed_error_mm"]["50%"] < 2.0
    assert found["share_of_observations_with_a_seen_ball"] > 0.8
    assert found["first_seen_ms"]["mean"] < 100.0
