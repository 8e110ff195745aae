"""Bursts end early for who sent them, alone or in a group."""

import o80

WAIT = 60.0


def test_a_burst_can_be_cancelled(bursting: o80.robots.Process) -> None:
    with bursting.frontend() as arm:
        burst = arm.burst(10**15, wait=False)
        seen = arm.wait_for_next(timeout=WAIT).iteration
        burst.cancel()
        last = burst.wait(WAIT).iteration

        assert last >= seen
        assert burst.done
        assert arm.burst(1, timeout=WAIT).iteration == last + 1


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
