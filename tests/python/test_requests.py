"""Requests to a robot, and purges."""

import pytest

import o80

WAIT = 30.0  # [s] longer than any wait should take


def test_a_request_is_served_at_once_and_leaves_what_was_added(arm: o80.Frontend) -> None:
    arm.add_command(0, 1.0)
    arm.burst(100)
    arm.add_command(1, 0.5)

    arm.request("reset", seed=1)

    assert arm.latest().fresh
    assert arm.latest().observed.tolist() == [0.0, 0.0]
    assert arm.added == 1


def test_a_rejected_request_raises_the_text_of_the_driver(arm: o80.Frontend) -> None:
    with pytest.raises(o80.RequestRejected, match="there are slots 0 to 7"):
        arm.request("snapshot", slot=8)


def test_an_unknown_request_or_field_is_refused_with_what_there_is(arm: o80.Frontend) -> None:
    with pytest.raises(o80.InvalidArgument, match="reset, snapshot, restore"):
        arm.request("launch")
    with pytest.raises(o80.InvalidArgument, match="seed"):
        arm.request("reset", sed=1)
    with pytest.raises(o80.InvalidArgument, match="seed"):
        arm.request("reset", seed=-1)


def test_a_request_may_be_part_of_a_pulse(arm: o80.Frontend) -> None:
    arm.add_command(0, 1.0)
    arm.burst(10)
    arm.add_request("reset", seed=1)
    arm.add_command(0, 0.5)

    observation = arm.burst(1)

    assert observation.desired[0] == 0.5


def test_snapshot_run_restore_run_is_the_same(arm: o80.Frontend) -> None:
    def run() -> list[list[float]]:
        first = arm.published + 1
        arm.add_command(0, 1.0, iterations=20)
        arm.burst(20)
        rows: list[list[float]] = arm.history(since=first).observed.tolist()
        return rows

    arm.request("snapshot", slot=3)
    once = run()
    arm.request("restore", slot=3)

    assert run() == once


def test_purge_needs_no_pulse(arm: o80.Frontend) -> None:
    arm.add_command(0, 1.0, iterations=100)
    arm.add_command(1, 1.0, iterations=100)
    batch = arm.pulse()
    arm.burst(10)

    arm.purge("shoulder")

    assert batch.statuses == [o80.Status.PURGED, o80.Status.ACTIVE]


def test_purge_of_all_drops_all(arm: o80.Frontend) -> None:
    arm.add_command(0, 1.0, iterations=100)
    arm.add_command(1, 1.0, iterations=100)
    batch = arm.pulse()

    arm.purge()

    assert batch.statuses == [o80.Status.PURGED, o80.Status.PURGED]


def test_a_purge_may_be_part_of_a_pulse(arm: o80.Frontend) -> None:
    arm.add_command(0, 1.0, iterations=100)
    first = arm.pulse()
    arm.add_purge(0)
    arm.add_command(0, 0.5, iterations=2)
    assert first.statuses != [o80.Status.PURGED]

    observation = arm.pulse_and_wait(timeout=WAIT)

    assert first.statuses == [o80.Status.PURGED]
    assert observation.desired[0] == 0.5
