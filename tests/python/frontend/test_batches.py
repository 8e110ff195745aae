"""Batches: what one pulse sent, and what became of it."""

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
