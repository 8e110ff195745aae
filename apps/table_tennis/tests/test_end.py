"""The reasons why an episode of ball play ends, of one or of many."""

import numpy as np
import pytest

from o80_table_tennis.task.ball_record import BallRecord
from o80_table_tennis.task.end import End, EndRule

LANDED = BallRecord(0.0, touched=True, landed=True)
CASES = [
    (BallRecord(1.0), 1.0, 299, End.RUNNING),
    (LANDED, 2.0, 299, End.LANDED),
    (LANDED, 2.0, 300, End.LANDED),
    (BallRecord(1.0, touched_net=True), 1.5, 299, End.NET),
    (BallRecord(1.0, touched=True, touched_floor=True), 3.5, 299, End.FLOOR),
    (BallRecord(1.0), -0.81, 299, End.PASSED),
    (BallRecord(1.0), -0.8, 299, End.RUNNING),
    (BallRecord(1.0), 1.0, 300, End.OUT_OF_STEPS),
]


@pytest.mark.parametrize(("record", "y", "steps", "end"), CASES)
def test_an_episode_ends_by_what_happens_to_the_ball(
    record: BallRecord, y: float, steps: int, end: End
) -> None:
    assert EndRule().judge(record, y, steps) == end
    assert bool(EndRule().ended(record, y, steps)) is (end is not End.RUNNING)


def test_many_episodes_are_judged_as_each_alone() -> None:
    names = BallRecord.__slots__
    records = BallRecord(
        *(np.array([getattr(record, name) for record, *_ in CASES]) for name in names)
    )
    y, steps = (np.array([case[place] for case in CASES]) for place in (1, 2))
    ends = np.array([end for *_, end in CASES])

    np.testing.assert_array_equal(EndRule().judge(records, y, steps), ends)
    np.testing.assert_array_equal(EndRule().ended(records, y, steps), ends != End.RUNNING)


def test_only_the_count_of_steps_truncates() -> None:
    assert [end for end in End if end.truncated] == [End.OUT_OF_STEPS]
    assert not any(end.terminated for end in (End.RUNNING, End.OUT_OF_STEPS))
    assert all(end.terminated for end in End if end not in (End.RUNNING, End.OUT_OF_STEPS))
    assert End.OUT_OF_STEPS.text == "out of steps"
