"""The 22 numbers of an observation, and their box."""

import ast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from recorded_rows import DATA

from o80_table_tennis.task import observations
from o80_table_tennis.task.ball_play import ReturnTask
from o80_table_tennis.task.ball_record import BallRecord
from o80_table_tennis.task.observations import ObservationBounds, observe_ball
from o80_table_tennis.task.observer import Observer
from o80_table_tennis.task.state import State


def state_of(motion: np.ndarray, pressures: np.ndarray, ball: np.ndarray) -> State:
    return State(0, motion, pressures, pressures, np.zeros(3), ball, BallRecord(1.0), np.zeros(3))


def test_each_part_of_an_observation_has_its_place() -> None:
    row = observe_ball(state_of(np.arange(8.0), np.arange(8.0, 16.0), np.arange(16.0, 22.0)))

    np.testing.assert_array_equal(row, np.arange(22.0))
    np.testing.assert_array_equal(row[observations.JOINT_VELOCITIES], [4, 5, 6, 7])
    np.testing.assert_array_equal(row[observations.BALL_POSITION], [16, 17, 18])


@settings(deadline=None)
@given(arrays(np.float64, (3, 22), elements=st.floats(-1e6, 1e6)))
def test_a_clipped_observation_lies_in_the_box(rows: np.ndarray) -> None:
    observer, bounds = Observer(ReturnTask(), 1), ObservationBounds()
    clipped = observer.clip(rows)

    assert clipped.dtype == np.float32
    assert np.all((clipped >= bounds.low) & (clipped <= bounds.high))
    assert all(row in observer.space for row in clipped)
    inside = (rows > bounds.low) & (rows < bounds.high)
    np.testing.assert_array_equal(clipped[inside], rows[inside].astype(np.float32))


def test_the_box_has_room_for_the_robot_and_its_balls() -> None:
    bounds = ObservationBounds()
    row = np.array(
        [0.17, 1.1, 1.04, 0.5, *[3.8] * 4, *[0.5] * 8, 0.46, 2.95, 1.37, 0.24, -4.14, 2.28]
    )

    assert np.all((row > bounds.low) & (row < bounds.high))
    assert bounds.high[0] > np.radians(89.8)


@pytest.mark.recordings("robot_and_ball_2022")
def test_the_logs_of_the_real_arm_lie_inside_the_bounds() -> None:
    bounds = ObservationBounds()
    for file in (DATA / "robot_and_ball_2022").iterdir():
        joints = [ast.literal_eval(line)[1][1:] for line in file.read_text().splitlines()]
        q, dq = (np.abs(np.array(values)) for values in zip(*joints, strict=True))
        assert q.max() < bounds.joint_position
        assert dq.max() < bounds.joint_velocity
    # of 50 other public logs, and of simulated muscles that are switched fully
    assert bounds.joint_position > 1.73
    assert bounds.joint_velocity > 39
