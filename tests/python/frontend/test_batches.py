"""Commands, their preview, and batches: what one pulse sent, and what became of it."""

import asyncio
import dataclasses
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from processes import WAIT

import o80


def test_a_batch_tells_when_it_was_taken_and_when_it_ended(arm: o80.Frontend) -> None:
    arm.burst(3)
    arm.add_command(0, 1.0, iterations=5)
    batch = arm.pulse()
    with pytest.raises(o80.Error, match="not taken yet, or was empty"):
        _ = arm.pulse().first_iteration
    with pytest.raises(o80.Error, match="has not ended yet"):
        _ = batch.last_iteration
    arm.burst(10)

    assert batch.ended
    assert (batch.first_iteration, batch.last_iteration) == (4, 8)
    assert (batch[0].iteration, batch[0].status, batch[0].reason) == (8, "completed", "none")


def test_a_wait_that_times_out_carries_the_batch(process: o80.robots.Process) -> None:
    with process.frontend() as arm:
        arm.add_command(0, 1.0, duration=1000.0)

        with pytest.raises(o80.TimeoutError) as caught:
            arm.pulse_and_wait(timeout=0.01)

        assert isinstance(caught.value, TimeoutError)
        batch = caught.value.batch
        assert batch is not None
        assert batch.handles[0].status in (o80.Status.QUEUED, o80.Status.ACTIVE)
        with pytest.raises(o80.TimeoutError) as again:
            batch.wait(0.0)
        assert again.value.batch is not None
        arm.purge()
        batch.wait(WAIT, check=False)
        assert batch.statuses == [o80.Status.PURGED]


def test_batches_outlive_their_frontend(process: o80.robots.Process) -> None:
    with process.frontend() as arm:
        arm.add_command(0, 0.5)
        batch = arm.pulse()
        batch.wait(WAIT)

    assert batch.statuses == [o80.Status.COMPLETED]
    assert "ended" in repr(batch)
    assert "completed" in repr(batch.handles[0])


def test_a_batch_is_a_sequence_of_handles_by_the_places_of_its_commands(arm: o80.Frontend) -> None:
    places = [
        arm.add_command("elbow", 0.1),
        arm.add_command(["shoulder", "elbow"], [0.1, 0.2]),
        arm.add_trajectory([[0.1, 0.2]]),
        arm.add_purge("elbow"),
        arm.add_request("reset", seed=1),
    ]
    batch = arm.pulse()
    assert places == [0, 1, 2, 3, 4]
    assert [handle.id for handle in batch] == [batch[place].id for place in places]
    assert batch[-1].id == batch.handles[-1].id
    for place in (5, -6):
        with pytest.raises(IndexError, match="the batch has 5 records"):
            _ = batch[place]


# rule C5
@pytest.mark.parametrize(
    ("pace", "iterations"),
    [
        ({}, 1),
        ({"iterations": 4}, 4),
        ({"duration": 0.005}, 5),
        ({"speed": 100.0}, 5),
        ({"until": 6}, 6),
    ],
)
def test_each_pace_takes_its_iterations(
    arm: o80.Frontend, pace: dict[str, float], iterations: int
) -> None:
    arm.add_command(0, 0.5, **pace)  # type: ignore[arg-type]

    observation = arm.pulse_and_wait(timeout=WAIT)

    assert observation.iteration == iterations
    assert observation.desired[0] == 0.5


# rule C4
def test_a_command_may_start_from_the_observed_state(arm: o80.Frontend) -> None:
    arm.add_command(0, 1.0)
    observed = arm.burst(1).observed[0]
    arm.add_command(0, 1.0, iterations=2, start=o80.Start.OBSERVED)

    assert arm.burst(1).desired[0] == pytest.approx((observed + 1.0) / 2)


# ------------------------------------------------------------------------------------ not completed


Wait = Callable[[o80.Frontend], object]


async def awaited(arm: o80.Frontend) -> object:
    return await arm.pulse()


WAITS: list[Wait] = [
    lambda arm: arm.pulse_and_wait(WAIT),
    lambda arm: arm.pulse().wait(WAIT),
    lambda arm: asyncio.run(awaited(arm)),
    lambda arm: asyncio.run(arm.aio.pulse_and_wait(WAIT)),
]


def too_late(arm: o80.Frontend) -> None:
    """Adds a command that will be rejected."""
    arm.wait_for(5, WAIT)
    arm.add_command("elbow", 0.5, until=3)


@pytest.mark.parametrize("wait", WAITS)
def test_every_wait_raises_for_a_command_that_is_too_late(
    process: o80.robots.Process, wait: Wait
) -> None:
    with process.frontend() as arm:
        too_late(arm)
        with pytest.raises(o80.NotCompleted, match="'elbow' was rejected in iteration") as raised:
            wait(arm)

        (handle,) = raised.value.handles
        assert (handle.status, handle.reason) == (o80.Status.REJECTED, o80.Reason.LATE)
        (end,) = raised.value.ends
        assert end == (handle.iteration, handle.status, ("elbow",), handle.reason, handle.text)
        assert raised.value.observation.iteration >= 5
        assert isinstance(raised.value, o80.Error)
        again = pickle.loads(pickle.dumps(raised.value))
        assert (str(again), again.ends) == (str(raised.value), raised.value.ends)
        assert again.observation.desired.tolist() == [0.0, 0.0]


def test_with_check_false_they_only_wait(process: o80.robots.Process) -> None:
    with process.frontend() as arm:
        too_late(arm)
        assert arm.pulse_and_wait(WAIT, check=False).iteration >= 5
        too_late(arm)
        batch = arm.pulse()
        batch.wait(WAIT, check=False)
        assert batch.statuses == [o80.Status.REJECTED]
        too_late(arm)
        asyncio.run(arm.aio.pulse_and_wait(WAIT, check=False))
        with pytest.raises(o80.InvalidArgument, match="check must be True or False"):
            batch.wait(WAIT, check=1)  # type: ignore[arg-type]


def test_a_burst_does_not_judge_commands(arm: o80.Frontend) -> None:
    arm.burst(5)
    arm.add_command("elbow", 0.5, until=3)
    assert arm.burst(2).iteration == 7
    arm.add_command("elbow", 0.5, until=3)
    assert o80.burst({arm: 2})[arm].iteration == 9


# ------------------------------------------------------------------------------------------ preview


JOINT = {"position": float, "velocity": float, "held": bool}


def test_it_says_how_many_iterations_and_the_states_of_all_actuators(arm: o80.Frontend) -> None:
    preview = arm.preview("elbow", 0.4, iterations=4)

    assert (preview.iterations, preview.late, preview.text) == (4, 0, "")
    assert preview.rows.tolist() == [[0, 0.1], [0, 0.2], [0, 0.30000000000000004], [0, 0.4]]
    assert arm.added == 0
    assert arm.latest().iteration == 0
    assert "rows" not in repr(preview)
    again = pickle.loads(pickle.dumps(preview))
    assert np.array_equal(again.rows, preview.rows)
    with pytest.raises(dataclasses.FrozenInstanceError):
        preview.late = 3  # type: ignore[misc]


def test_it_may_begin_elsewhere(arm: o80.Frontend) -> None:
    first = arm.preview(None, [0.4, 0.8], iterations=2)
    then = arm.preview("elbow", 0.0, iterations=2, initial=first.rows[-1][1])
    both = arm.preview([1, 0], [0.0, 0.2], iterations=2, initial=[0.8, 0.4])

    assert then.rows.tolist() == [[0, 0.4], [0, 0]]
    assert both.rows.tolist() == [[0.30000000000000004, 0.4], [0.2, 0]]


def test_initial_fields_that_are_left_out_are_those_of_the_newest_row(segment: str) -> None:
    with o80.Backend(segment, ["joint"], JOINT) as backend:
        backend.publish({"position": 1.0, "velocity": 2.0, "held": True})
        preview = o80.Frontend(segment).preview(
            "joint", {"position": 4.0}, iterations=2, initial={"position": 2.0}
        )

    assert preview.rows[:, 0].tolist() == [(3.0, 2.0, True), (4.0, 2.0, True)]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"target": 4.0}, "outside its limits"),
        ({"target": 0.1, "initial": "here"}, "initial: the target of actuator 'elbow'"),
        ({"target": 0.1, "initial": float("inf")}, "'elbow' begins"),
        ({"target": [0.1], "actuator": ["elbow"], "initial": 0.1}, "initial: a command for 1"),
    ],
)
def test_wrong_input_is_refused(arm: o80.Frontend, arguments: dict[str, Any], says: str) -> None:
    with pytest.raises(o80.InvalidArgument, match=says):
        arm.preview(**{"actuator": "elbow", **arguments})
    assert arm.added == 0
