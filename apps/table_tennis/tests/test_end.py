"""The reasons why an episode of ball play ends."""

import numpy as np
import pytest
from ball_records import landing_at, stacked_records
from opened_environment import opened

from o80_table_tennis.rig.ball_records import BallRecords
from o80_table_tennis.task.ball_record import BallRecord
from o80_table_tennis.task.end import End, EndRule, terminated
from o80_table_tennis.task.outcome import returned
from o80_table_tennis.world.table import NET_Y, TABLE

FAR = landing_at(0.0, 2.0)
NET_BALL = BallRecord(0.0, touched=True, landed=True, landing=FAR.landing, touched_net=True)
CASES = [
    (BallRecord(1.0), 1.0, 299, End.RUNNING),
    (FAR, 2.0, 299, End.RETURNED),
    (FAR, 2.0, 300, End.RETURNED),
    (landing_at(0.0, NET_Y - 0.02), 1.0, 299, End.OWN_HALF),
    (landing_at(0.0, 2.94, z=TABLE.top - 0.01), 3.0, 299, End.TABLE_SIDE),
    (NET_BALL, 2.0, 299, End.NET),
    (BallRecord(1.0, touched_net=True), 1.5, 299, End.NET),
    (BallRecord(1.0, touched=True, touched_floor=True), 3.5, 299, End.FLOOR),
    (BallRecord(1.0), -0.81, 299, End.PASSED),
    (BallRecord(1.0), -0.8, 299, End.RUNNING),
    (BallRecord(1.0), 1.0, 300, End.OUT_OF_STEPS),
]


def test_an_episode_ends_by_what_happens_to_the_ball() -> None:
    records = stacked_records([record for record, *_ in CASES])
    y, steps = (np.array([case[place] for case in CASES]) for place in (1, 2))
    ends = np.array([end for *_, end in CASES])

    judged = EndRule().judge(records, y, steps)
    assert [End(end) for end in judged] == ends.tolist()
    np.testing.assert_array_equal(EndRule().ended(records, y, steps), ends != End.RUNNING)
    np.testing.assert_array_equal(returned(records), ends == End.RETURNED)
    np.testing.assert_array_equal(terminated(ends), [End(end).terminated for end in ends])


def test_only_the_count_of_steps_and_a_stall_truncate() -> None:
    assert [end for end in End if end.truncated] == [End.OUT_OF_STEPS, End.STALLED]
    assert [end for end in End if not end.terminated and not end.truncated] == [End.RUNNING]
    assert End.OUT_OF_STEPS.text == "out of steps"


@pytest.mark.parametrize(
    ("net_at", "landed_at", "touched_net"),
    [(-1, -1, False), (7, -1, True), (7, 9, True), (7, 7, True), (9, 7, False)],
)
def test_a_net_ball_is_one_that_touched_the_net_before_it_landed(
    net_at: int, landed_at: int, touched_net: bool
) -> None:
    with opened() as environment:
        records = environment.task.rows.records.copy()
    records["racket"]["count"], records["net"]["count"] = 1, net_at >= 0
    records["net"]["iteration"], records["table"]["iteration"] = net_at, landed_at
    records["net"]["position"], records["floor"]["position"] = (1, 2, 3), (4, 5, 6)

    record = BallRecords(records).read().at(0)
    assert (record.touched, record.touched_net) == (True, touched_net)
    assert record.landed == (landed_at >= 0)
    assert tuple(record.net_position) == (1, 2, 3)
    assert tuple(record.floor_position) == (4, 5, 6)
