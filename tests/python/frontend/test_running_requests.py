"""Requests that take time."""

from collections.abc import Iterator

import numpy as np
import pytest

import o80

WAIT = 30.0  # [s] longer than any wait should take


@pytest.fixture
def backend(segment: str) -> Iterator[o80.Backend]:
    """Two joints that home, in bursting mode; row 0 is out."""
    requests = {"home": {"speed": float}, "calibrate": None, "abandon": None}
    with o80.Backend(
        segment, ["a", "b"], requests=requests, while_halted=["calibrate"], bursting=True
    ) as made:
        made.on("home", lambda _: o80.Running("looks for the index of joint 1"))
        made.on("calibrate", lambda _: o80.Running())
        made.publish([1.0, 2.0])
        yield made


def iterate(backend: o80.Backend, frontend: o80.Frontend, iterations: int = 1) -> None:
    """Both sides of a burst, in this thread."""
    frontend.burst(iterations, wait=False)
    for _ in range(iterations):
        assert backend.step(WAIT) is not None
        backend.publish()


def home(frontend: o80.Frontend) -> o80.Batch:
    frontend.add_request("home", speed=0.5)
    return frontend.pulse()


def test_it_is_active_with_its_progress_until_it_ends(backend: o80.Backend, segment: str) -> None:
    with o80.Frontend(segment) as frontend:
        batch = home(frontend)
        iterate(backend, frontend, 2)
        assert batch.handles[0].status == o80.Status.ACTIVE
        assert batch.handles[0].progress == "looks for the index of joint 1"
        assert "looks for the index" in repr(batch.handles[0])
        assert not batch.ended

        backend.progress("home", "looks for the index of joint 2")
        assert batch.handles[0].progress == "looks for the index of joint 2"
        assert backend.running("home")

        backend.end_request("home")
        assert batch.handles[0].status == o80.Status.ACTIVE, "its row is not out"
        iterate(backend, frontend)
        assert batch.statuses == [o80.Status.COMPLETED]
        assert batch.handles[0].progress == ""
        assert not backend.running("home")


def test_it_may_be_ended_by_another_with_a_fresh_start_or_a_reason(
    backend: o80.Backend, segment: str
) -> None:
    backend.on("abandon", lambda _: backend.end_request("home", rejected="abandoned"))
    with o80.Frontend(segment) as frontend:
        batch = home(frontend)
        iterate(backend, frontend)
        backend.end_request("home", o80.StartAfresh([0.0, 0.0]))
        iterate(backend, frontend)
        assert batch.statuses == [o80.Status.COMPLETED]
        assert frontend.wait_for(batch.last_iteration).desired.tolist() == [0.0, 0.0]
        batch = home(frontend)
        iterate(backend, frontend)
        frontend.add_request("abandon")
        frontend.pulse()
        iterate(backend, frontend)
        assert batch.handles[0].text == "abandoned"


def test_what_is_no_answer_or_no_end_is_refused(backend: o80.Backend, segment: str) -> None:
    with pytest.raises(o80.InvalidArgument, match="home, calibrate, abandon"):
        backend.end_request("hom")
    with pytest.raises(o80.InvalidArgument, match="must be None or"):
        backend.end_request("home", o80.Running())  # type: ignore[arg-type]
    with pytest.raises(o80.InvalidArgument, match="not both"):
        backend.end_request("home", o80.StartAfresh([0, 0]), rejected="why")
    backend.end_request("home")  # it does not run: nothing happens

    backend.on("abandon", lambda _: "soon")  # type: ignore[arg-type, return-value]
    with o80.Frontend(segment) as frontend:
        frontend.add_request("abandon")
        frontend.burst(1, wait=False)
        with pytest.raises(o80.InvalidArgument, match=r"'abandon' must .*o80\.Running.*'soon'"):
            backend.step(WAIT)


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


def test_desired_states_are_not_followed_while_it_runs(arm: o80.Frontend) -> None:
    arm.add_command(None, [0.5, 0.3])
    arm.burst(1000)
    arm.add_request("home", speed=0.1)
    batch = arm.pulse()
    arm.add_command(0, 2.0, duration=0.5)
    arm.burst(200)
    assert batch.handles[0].progress == "the shoulder moves"
    np.testing.assert_allclose(arm.latest().observed[0], 0.5 - 0.1 * 0.2, atol=1e-3)


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


def test_a_reset_in_the_middle_is_repeated_bit_for_bit(arm: o80.Frontend) -> None:
    def run() -> list[list[float]]:
        arm.request("reset")
        first = arm.published
        arm.add_command(None, [0.5, 0.3])
        arm.burst(300)
        arm.add_request("home")
        arm.pulse()
        arm.burst(100)
        rows: list[list[float]] = arm.history(since=first).observed.tolist()
        return rows

    assert run() == run()
