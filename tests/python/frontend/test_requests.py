"""Requests to a robot: served at once, or running until their end."""

from collections.abc import Iterator
from typing import Any

import pytest
from manual_backend import ManualBackend
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


@pytest.fixture
def robot(segment: str) -> Iterator[ManualBackend]:
    """Two joints that home, in bursting mode."""
    requests = {"home": {"speed": float}, "calibrate": None, "abandon": None}
    options: Any = {"requests": requests, "while_halted": ["calibrate"], "bursting": True}
    with ManualBackend(segment, ["a", "b"], **options) as made:
        made.backend.on("home", lambda _: o80.Running("looks for the index of joint 1"))
        made.backend.on("calibrate", lambda _: o80.Running())
        yield made


def home(frontend: o80.Frontend) -> o80.Batch:
    frontend.add_request("home", speed=0.5)
    return frontend.pulse()


def test_it_is_active_with_its_progress_until_it_ends(robot: ManualBackend) -> None:
    batch = home(robot.frontend)
    robot.run(2)
    assert batch.handles[0].status == o80.Status.ACTIVE
    assert batch.handles[0].progress == "looks for the index of joint 1"
    assert "looks for the index" in repr(batch.handles[0])
    assert not batch.ended

    robot.backend.progress("home", "looks for the index of joint 2")
    assert batch.handles[0].progress == "looks for the index of joint 2"
    assert robot.backend.running("home")

    robot.backend.end_request("home")
    assert batch.handles[0].status == o80.Status.ACTIVE, "its row is not out"
    robot.run()
    assert batch.statuses == [o80.Status.COMPLETED]
    assert batch.handles[0].progress == ""
    assert not robot.backend.running("home")


def test_what_is_no_answer_or_no_end_is_refused(robot: ManualBackend) -> None:
    backend = robot.backend
    with pytest.raises(o80.InvalidArgument, match="home, calibrate, abandon"):
        backend.end_request("hom")
    with pytest.raises(o80.InvalidArgument, match="must be None or"):
        backend.end_request("home", o80.Running())  # type: ignore[arg-type]
    with pytest.raises(o80.InvalidArgument, match="not both"):
        backend.end_request("home", o80.StartAfresh([0, 0]), rejected="why")
    backend.end_request("home")  # it does not run: nothing happens
    batch = home(robot.frontend)
    robot.run()
    backend.end_request("home", rejected="abandoned")
    robot.run()
    assert batch.handles[0].text == "abandoned"
    batch = home(robot.frontend)
    robot.run()
    backend.end_request("home", o80.StartAfresh([1.0, 2.0]))
    robot.run()
    assert batch.statuses == [o80.Status.COMPLETED]
    assert robot.frontend.wait_for(batch.last_iteration).desired.tolist() == [1.0, 2.0]

    backend.on("abandon", lambda _: "soon")  # type: ignore[arg-type, return-value]
    robot.frontend.add_request("abandon")
    with pytest.raises(o80.InvalidArgument, match=r"'abandon' must .*o80\.Running.*'soon'"):
        robot.run()


# ---------------------------------------------------------------------- the tutorial robot


def test_a_request_waits_for_its_end(arm: o80.Frontend) -> None:
    arm.add_command(None, [0.5, 0.3])
    arm.burst(1000)
    before = arm.published

    arm.request("home", speed=1.0)

    taken = arm.published - before
    assert 750 < taken < 850, "0.8 rad at 1 rad/s and 1000 Hz, and its fresh row"
    assert arm.latest().fresh
    assert arm.latest().observed.tolist() == [0.0, 0.0]
    assert arm.latest().desired.tolist() == [0.0, 0.0]
    assert arm.running_requests == []


def test_a_timeout_says_that_it_goes_on(process: o80.robots.Process) -> None:
    with process.frontend() as arm:
        arm.add_command(None, [2.0, 2.0])
        arm.pulse_and_wait(timeout=WAIT)
        while arm.latest().observed[0] < 1.0:
            arm.wait_for_next(timeout=WAIT)
        with pytest.raises(o80.TimeoutError, match=r"'home' of .* still runs") as raised:
            arm.request("home", speed=1e-3, timeout=0.2)
        batch = raised.value.batch
        assert batch is not None
        assert not batch.ended
        arm.request("reset")
        with pytest.raises(o80.NotCompleted, match="request 'home' was rejected"):
            batch.wait(WAIT)
        assert "a reset or a restore has ended it" in batch.handles[0].text
