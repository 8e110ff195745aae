"""Bursts end early for who sent them, alone or in a group."""

from processes import WAIT

import o80


def test_a_group_may_return_at_once(segment: str) -> None:
    robot = o80.robots.load("two_joints")
    with (
        robot.start(f"{segment}-left", bursting=True) as one,
        robot.start(f"{segment}-right", bursting=True) as two,
        one.frontend() as left,
        two.frontend() as right,
    ):
        group = o80.burst({left: 5, right: 7}, wait=False)
        rows = group.wait(WAIT)

        assert group.done
        assert {left: rows[left].iteration, right: rows[right].iteration} == {left: 5, right: 7}
        assert group.bursts[left].done

        group = o80.burst({left: 10**15, right: 10**15}, wait=False)
        assert not group.done
        group.cancel()
        rows = group.wait(WAIT)
        assert left.burst(1, timeout=WAIT).iteration == rows[left].iteration + 1

        burst = left.burst(10**15, wait=False)
        seen = left.wait_for_next(timeout=WAIT).iteration
        burst.cancel()
        assert burst.wait(WAIT).iteration >= seen
        assert burst.done
