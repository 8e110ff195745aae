"""Data are sent by pickle; objects that belong to a process say what to send instead."""

import copy
import multiprocessing
import pickle
from typing import Any

import pytest
from processes import WAIT

import o80


def content(observation: Any) -> bytes:
    return bytes(memoryview(observation))


def same(one: o80.Observation, other: o80.Observation) -> bool:
    return content(one) == content(other) and one.missed == other.missed


@pytest.mark.parametrize("protocol", range(2, pickle.HIGHEST_PROTOCOL + 1))
def test_observations_and_histories_are_data(arm: o80.Frontend, protocol: int) -> None:
    """Rows of every layout are in rows/test_row_layouts.py."""
    row = arm.burst(3)
    observation, history = pickle.loads(pickle.dumps((row, arm.history()), protocol=protocol))

    assert same(observation, row)
    assert observation.extended.effort.tolist() == row.extended.effort.tolist()
    assert isinstance(history, o80.History)
    assert same(history[-1], row)
    assert same(copy.deepcopy(observation), row)


def test_many_observations_are_pickled_with_one_description(arm: o80.Frontend) -> None:
    arm.burst(101)
    one = len(pickle.dumps(arm.latest()))
    rows = [*arm.history(100)]

    many = pickle.dumps(rows)

    assert len(many) < one + 100 * (memoryview(rows[0]).nbytes + 60)
    assert all(map(same, pickle.loads(many), rows))


def test_handles_are_data_also_those_of_a_timeout(arm: o80.Frontend) -> None:
    arm.add_command(0, 1.0, iterations=5)
    batch = arm.pulse()
    with pytest.raises(o80.TimeoutError) as raised:
        batch.wait(0.0)

    error = pickle.loads(pickle.dumps(raised.value))
    handle = pickle.loads(pickle.dumps(batch.handles[0]))

    assert str(error) == str(raised.value)
    assert [h.status for h in error.handles] == [o80.Status.QUEUED]
    assert (handle.id, handle.status, handle.reason) == (
        batch.handles[0].id,
        o80.Status.QUEUED,
        o80.Reason.NONE,
    )


def test_errors_and_robots_are_data() -> None:
    error = pickle.loads(pickle.dumps(o80.BackendKilled("it was killed")))
    robot = pickle.loads(pickle.dumps(o80.robots.load("two_joints")))

    assert (type(error), str(error)) == (o80.BackendKilled, "it was killed")
    assert robot.name == "two_joints"


def test_what_belongs_to_a_process_says_what_to_send(segment: str) -> None:
    with (
        o80.robots.load("two_joints").start(segment) as process,
        process.frontend() as arm,
        o80.Backend(f"{segment}-b", ["a"]) as backend,
        o80.robots.load("two_joints").inline() as inline,
    ):
        for thing, instead in {
            process: "send its segment's name",
            backend: "send its segment's name",
            arm.pulse(): "send its handles",
            arm.stream(): "send its frontend",
            inline: "Attach to its segment",
            inline.burst(1, wait=False): "send the observation",
        }.items():
            for fails in (pickle.dumps, copy.copy):
                with pytest.raises(TypeError, match=instead):
                    fails(thing)


def look(frontend: o80.Frontend) -> o80.Observation:
    """In a process of its own."""
    frontend.add_command("elbow", 0.5)
    return frontend.pulse_and_wait(WAIT)


def fail(segment: str) -> None:
    with o80.Frontend(segment) as arm:
        arm.add_command(0, 1.0, duration=1e6)
        arm.pulse_and_wait(0.0)


@pytest.mark.parametrize("way", ["fork", "spawn"])
def test_workers_get_frontends_and_give_observations_and_errors(
    process: o80.robots.Process, way: str
) -> None:
    with process.frontend() as arm, multiprocessing.get_context(way).Pool(1) as pool:
        seen = pool.apply_async(look, (arm,)).get(WAIT)
        assert seen.desired[1] == 0.5
        assert same(arm.wait_for(seen.iteration, WAIT), seen)
        with pytest.raises(o80.TimeoutError) as raised:
            pool.apply_async(fail, (process.segment,)).get(WAIT)
        assert len(raised.value.handles) == 1
        assert arm.alive


kept: Any = None


def leave_open(names: Any) -> None:
    global kept
    kept = o80.robots.load("two_joints").inline()
    kept.burst(1)
    names.put(kept.segment)


@pytest.mark.parametrize("way", ["fork", "spawn"])
def test_a_worker_that_closes_nothing_leaves_no_segment(way: str) -> None:
    context: Any = multiprocessing.get_context(way)
    names = context.SimpleQueue()
    worker = context.Process(target=leave_open, args=(names,))
    worker.start()
    name = names.get()
    worker.join(WAIT)

    assert worker.exitcode == 0
    assert name not in [entry.name for entry in o80.segments()]
