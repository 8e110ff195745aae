"""A backend inside a Python program, by its own clock and bursting."""

import contextlib
import threading
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from processes import WAIT

import o80


@contextlib.contextmanager
def running(backend: o80.Backend) -> Iterator[list[Exception]]:
    """A robot that is at once where it is asked to be, in a thread; what this raised."""
    raised: list[Exception] = []

    def run() -> None:
        try:
            while (desired := backend.step()) is not None:
                backend.publish(desired)
        except Exception as error:
            raised.append(error)
            backend.__exit__(type(error), error, None)

    thread = threading.Thread(target=run)
    thread.start()
    yield raised
    if not raised:
        backend.stop()
    thread.join(WAIT)
    assert not thread.is_alive()


def test_the_two_verbs_make_a_robot(segment: str) -> None:
    with o80.Backend(segment, ["a", "b"], frequency=100.0) as backend:
        with pytest.raises(o80.InvalidArgument, match="row 0"):
            backend.step()
        with pytest.raises(o80.InvalidArgument, match="actuator 'b'"):
            backend.publish([0.5, float("nan")])
        backend.publish([0.5, -0.5])
        with o80.Frontend(segment) as frontend:
            frontend.add_command("a", 1.0, iterations=2)
            frontend.pulse()
            first = backend.step()
            backend.publish(first)
            second = backend.step()
            backend.publish(second)

            assert first.tolist() == [0.75, -0.5]
            assert second.tolist() == [1.0, -0.5]
            assert frontend.latest().observed.tolist() == [1.0, -0.5]
            assert frontend.frequency == pytest.approx(100.0)
            assert not frontend.bursting
            assert backend.iteration == 3
            assert frontend.robot == segment


def test_desired_states_are_fresh_arrays(segment: str) -> None:
    with o80.Backend(segment, ["a"]) as backend:
        backend.publish([0.0])
        with o80.Frontend(segment) as frontend:
            first = backend.step()
            first[0] = 99.0
            backend.publish([0.0])
            frontend.add_command(0, 1.0)
            frontend.pulse()

            assert backend.step().tolist() == [1.0]
            assert first.tolist() == [99.0]


def test_published_values_stay_until_they_are_given_anew(segment: str) -> None:
    sensors = {"force": (float, 2), "count": int}
    with o80.Backend(segment, ["a", "b"], extended=sensors) as backend:
        backend.publish([1.0, 2.0], {"force": [3.0, 4.0], "count": 1})
        with o80.Frontend(segment) as frontend:
            backend.step()
            backend.publish(extended={"count": 2})

            observation = frontend.latest()
            assert observation.observed.tolist() == [1.0, 2.0]
            assert observation.extended.force.tolist() == [3.0, 4.0]
            assert observation.extended.count == 2


def test_limits_idle_and_units_reach_the_frontend(segment: str) -> None:
    with o80.Backend(
        segment,
        {"joints": ({"position": float, "torque": float}, 2), "hand": float},
        limits={0: {"torque": (-5, None)}, "hand": (0, 1, 2)},
        when_idle={"hand": "follow"},
        units={"position": "rad", "hand.": "m"},
    ) as backend:
        backend.publish()
        with o80.Frontend(segment) as frontend:
            first, _, hand = frontend.actuators
            assert [number.name for number in first.numbers] == ["position", "torque"]
            assert first.numbers[0].unit == "rad"
            assert first.numbers[1].limits == o80.Limits(minimum=-5.0)
            assert hand.limits == o80.Limits(minimum=0.0, maximum=1.0, speed=2.0)
            assert hand.when_idle == "follow"
            assert first.when_idle == "hold"
            assert first.name == "joints_0"


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"actuators": ["a", "a"]}, "two actuators are called 'a'"),
        ({"actuators": "ab"}, "names"),
        ({"actuators": ["a"], "dtype": "U8"}, "dtype"),
        ({"actuators": ["a"], "dtype": np.float16}, "float16"),
        ({"actuators": -1}, "number of actuators must be at least 0, got -1"),
        ({"actuators": ["a"], "requests": ["home"]}, "requests must be a mapping from names"),
        ({"actuators": ["a"], "limits": [1.0]}, "limits must be a mapping from actuators"),
        ({"actuators": ["a"], "limits": {"b": (0, 1)}}, "there are: a"),
        ({"actuators": ["a"], "limits": {"a": (1, 0)}}, "limits of actuator 'a'"),
        ({"actuators": ["a"], "when_idle": "rest"}, "'hold' or 'follow'"),
        ({"actuators": ["a"], "frequency": 0}, "frequency"),
        ({"actuators": ["a"], "extended": {"m": (float, (2, 2, 2))}}, "at most 2"),
    ],
)
def test_a_description_that_cannot_be_is_refused(
    segment: str, arguments: dict[str, Any], text: str
) -> None:
    with pytest.raises(o80.InvalidArgument, match=text):
        o80.Backend(segment, **arguments)

    assert segment not in [entry.name for entry in o80.segments()]


@pytest.mark.parametrize("observed", [[1.0], [1.0, 2.0, 3.0], ["x", "y"], {"a": 1.0}])
def test_states_of_another_shape_and_unknown_fields_are_refused(
    segment: str, observed: object
) -> None:
    with o80.Backend(segment, ["a", "b"], extended={"missing": {"arm": bool}}) as backend:
        with pytest.raises(o80.InvalidArgument, match="observed"):
            backend.publish(observed)
        with pytest.raises(o80.InvalidArgument, match=r"extended.missing has no field 'amr'"):
            backend.publish(extended={"missing": {"amr": True}})


# ---------------------------------------------------------------------------- requests


REQUESTS = {"reset": {"seed": np.uint64, "pose": (float, 2)}, "home": None, "brake": None}


def test_requests_reach_their_handlers(segment: str) -> None:
    heard: list[Any] = []

    def reset(request: o80.Record) -> None:
        heard.append((int(request.seed), request.pose.tolist()))

    with o80.Backend(segment, ["a"], requests=REQUESTS, bursting=True) as backend:
        backend.on("reset", reset)
        home: Any = list(REQUESTS).index("home")  # a request by its number, as elsewhere
        backend.on(home, lambda request: heard.append(len(request)))
        backend.publish([0.0])
        with running(backend), o80.Frontend(segment) as frontend:
            frontend.request("reset", seed=2**63, pose=[1.0, 2.0], timeout=WAIT)
            frontend.request("home", timeout=WAIT)
            with pytest.raises(o80.RequestRejected, match="request 'brake' has no handler"):
                frontend.request("brake", timeout=WAIT)

    assert heard == [(2**63, [1.0, 2.0]), 0]


def test_a_handler_may_start_afresh(segment: str) -> None:
    with o80.Backend(
        segment, ["a", "b"], extended={"n": int}, requests=REQUESTS, bursting=True
    ) as backend:
        backend.on("reset", lambda _: o80.StartAfresh([3.0, 4.0], {"n": 5}))
        backend.on("home", lambda _: o80.StartAfresh([3.0, 4.0], desired=[1.0, 2.0]))
        backend.publish([0.0, 0.0])
        with running(backend), o80.Frontend(segment) as frontend:
            frontend.add_command(0, 1.0, iterations=100)
            batch = frontend.pulse()
            frontend.burst(10, timeout=WAIT)

            frontend.request("reset", seed=0, pose=[0.0, 0.0], timeout=WAIT)

            fresh = frontend.latest()
            assert (fresh.fresh, fresh.iteration) == (True, 11)
            assert fresh.observed.tolist() == fresh.desired.tolist() == [3.0, 4.0]
            assert fresh.extended.n == 5
            assert batch.statuses == [o80.Status.PURGED]
            assert batch.handles[0].reason == o80.Reason.FRESH_START
            assert frontend.burst(1, timeout=WAIT).desired.tolist() == [3.0, 4.0]

            frontend.request("home", timeout=WAIT)

            assert frontend.latest().desired.tolist() == [1.0, 2.0]


class UntellableError(ZeroDivisionError):
    def __str__(self) -> str:
        raise KeyError("no text")


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (ZeroDivisionError("no such home"), "ZeroDivisionError: no such home"),
        (ZeroDivisionError("no such \ud800"), r"no such \\ud800"),  # it has no UTF-8
        (UntellableError(), "UntellableError"),
    ],
)
def test_a_handler_that_fails_ends_the_backend(
    segment: str, error: ZeroDivisionError, told: str
) -> None:
    def home(_: o80.Record) -> None:
        raise error

    with o80.Backend(segment, ["a"], requests=REQUESTS, bursting=True) as backend:
        backend.on("home", home)
        backend.publish([0.0])
        with running(backend) as raised, o80.Frontend(segment) as frontend:
            with pytest.raises(o80.Error, match=told):
                frontend.request("home", timeout=WAIT)
            with pytest.raises(o80.BackendFailed, match=told):
                frontend.wait_for(10**6, timeout=WAIT)
            with pytest.raises(o80.BackendFailed, match=told):
                o80.Frontend(segment, timeout=WAIT)

    assert isinstance(raised[0], ZeroDivisionError)


def test_only_known_requests_have_handlers_and_only_actuators_are_interrupted(segment: str) -> None:
    with o80.Backend(segment, ["a"], requests=REQUESTS) as backend:
        with pytest.raises(o80.InvalidArgument, match="reset, home, brake"):
            backend.on("launch", lambda _: None)
        for wrong in ("c", 1):
            with pytest.raises(o80.InvalidArgument, match="there are: a"):
                backend.interrupt(wrong)
