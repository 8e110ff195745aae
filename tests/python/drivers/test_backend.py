"""A backend inside a Python program, by its own clock and bursting."""

import contextlib
from typing import Any

import numpy as np
import pytest
from manual_backend import ManualBackend
from processes import WAIT

import o80


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
            assert first.tolist() == [0.75, -0.5]
            backend.publish(first)
            first[:] = 99.0  # desired states are fresh arrays
            second = backend.step()
            backend.publish(second)

            assert second.tolist() == [1.0, -0.5]
            assert first.tolist() == [99.0, 99.0]
            assert frontend.latest().observed.tolist() == [1.0, -0.5]
            assert frontend.frequency == pytest.approx(100.0)
            assert not frontend.bursting
            assert backend.iteration == 3
            assert frontend.robot == segment


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
            assert (first.numbers[0].unit, hand.numbers[0].unit) == ("rad", "m")
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

    with ManualBackend(segment, ["a"], requests=REQUESTS) as robot:
        robot.backend.on("reset", reset)
        home: Any = list(REQUESTS).index("home")  # a request by its number, as elsewhere
        robot.backend.on(home, lambda request: heard.append(len(request)))
        robot.frontend.add_request("reset", seed=2**63, pose=[1.0, 2.0])
        robot.frontend.add_request("home")
        robot.frontend.add_request("brake")
        batch = robot.frontend.pulse()
        robot.run()

    assert heard == [(2**63, [1.0, 2.0]), 0]
    assert batch.statuses == ["completed", "completed", "rejected"]
    assert "request 'brake' has no handler" in batch[2].text


def test_a_handler_may_start_afresh(segment: str) -> None:
    with ManualBackend(segment, ["a", "b"], extended={"n": int}, requests=REQUESTS) as robot:
        robot.backend.on("reset", lambda _: o80.StartAfresh([3.0, 4.0], {"n": 5}))
        robot.backend.on("home", lambda _: o80.StartAfresh([3.0, 4.0], desired=[1.0, 2.0]))
        arm = robot.frontend
        arm.add_command(0, 1.0, iterations=100)
        batch = arm.pulse()
        robot.run(10)
        arm.add_request("reset", seed=0, pose=[0.0, 0.0])
        arm.pulse()
        assert robot.run().tolist() == [3.0, 4.0]

        fresh = arm.wait_for(11)
        assert fresh.fresh
        assert fresh.observed.tolist() == fresh.desired.tolist() == [3.0, 4.0]
        assert fresh.extended.n == 5
        assert batch.statuses == [o80.Status.PURGED]
        assert batch.handles[0].reason == o80.Reason.FRESH_START

        arm.add_request("home")
        arm.pulse()
        assert robot.run().tolist() == [1.0, 2.0]


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

    with (
        contextlib.suppress(ZeroDivisionError),
        o80.Backend(segment, ["a"], requests=REQUESTS) as backend,
    ):
        backend.on("home", home)
        backend.publish([0.0])
        arm = o80.Frontend(segment)
        arm.add_request("home")
        arm.pulse()
        backend.step()
        pytest.fail("the handler has not ended it")
    for wait in (lambda: arm.wait_for(10**6, WAIT), lambda: o80.Frontend(segment, WAIT)):
        with pytest.raises(o80.BackendFailed, match=told):
            wait()
    arm.close()


def test_only_known_requests_have_handlers_and_only_actuators_are_interrupted(segment: str) -> None:
    with o80.Backend(segment, ["a"], requests=REQUESTS) as backend:
        with pytest.raises(o80.InvalidArgument, match="reset, home, brake"):
            backend.on("launch", lambda _: None)
        for wrong in ("c", 1):
            with pytest.raises(o80.InvalidArgument, match="there are: a"):
                backend.interrupt(wrong)
