"""Requests to a robot, and purges."""

import pytest
from processes import WAIT

import o80


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


# rule B9
def test_fields_without_a_default_must_be_given(segment: str) -> None:
    gains = {"stiffness": float, "of": {"joint": int, "axis": int}}
    with o80.Backend(segment, ["a"], requests={"set_gains": gains}, bursting=True) as backend:
        taken: list[tuple[object, ...]] = []

        def set_gains(request: o80.Record) -> None:
            taken.append((request.stiffness, request.of.joint, request.of.axis))

        backend.on("set_gains", set_gains)
        backend.publish([0.0])
        with o80.Frontend(segment) as arm:
            with pytest.raises(o80.InvalidArgument, match="'set_gains' needs 'stiffness'"):
                arm.request("set_gains")
            with pytest.raises(o80.InvalidArgument, match="needs 'of'"):
                arm.add_request("set_gains", stiffness=1.0)
            with pytest.raises(o80.InvalidArgument, match=r"'of' of .*'set_gains' needs 'axis'"):
                arm.add_request("set_gains", stiffness=1.0, of={"joint": 2})
            assert arm.added == 0

            arm.add_request("set_gains", stiffness=1.0, of={"joint": 2, "axis": 3})
            arm.burst(1, wait=False)
            backend.step(WAIT)
    assert taken == [(1.0, 2, 3)]
