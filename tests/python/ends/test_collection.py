"""Dropped objects are given back, whatever state they were in; views keep what they show."""

import gc
import os
import weakref
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from processes import WAIT, run_python

import o80


def held() -> dict[str, int]:
    """Resources of the system that this process holds."""
    gc.collect()
    return {
        "descriptors": len(os.listdir("/proc/self/fd")),
        "threads": len(os.listdir("/proc/self/task")),
        "maps of segments": Path("/proc/self/maps").read_text().count("/o80-"),
    }


@pytest.fixture(autouse=True)
def _frozen() -> Iterator[None]:
    """The collector leaves out what was there before: all modules of a session take it long."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.fixture
def standing(segment: str) -> Any:
    """A bursting backend that nobody steps."""
    with o80.Backend(segment, ["a", "b"], bursting=True, history=64) as backend:
        backend.publish([0.0, 0.0])
        yield backend


def command(segment: str) -> None:
    with o80.Frontend(segment) as frontend:
        frontend.add_command(0, 1.0)
        frontend.pulse()


def drop_all(segment: str) -> None:
    frontend = o80.Frontend(segment)
    frontend.add_command(0, 1.0)
    batch, rows = frontend.pulse(), frontend.stream()
    burst = frontend.burst(1, wait=False)
    history = frontend.history()
    cycle: list[Any] = [frontend, batch, rows, burst, history]
    cycle.append(cycle)
    del frontend, batch, rows, burst, history, cycle
    gc.collect()  # or the lanes would be used up


def fail_half_way(segment: str) -> None:
    with pytest.raises(o80.InvalidArgument):
        o80.Frontend(segment, on_error="unknown")  # type: ignore[arg-type]
    with pytest.raises(o80.SegmentTaken):
        o80.Backend(segment, ["a"])
    with pytest.raises(o80.DriverError):
        o80.robots.load("no such robot")
    with pytest.raises(o80.InvalidArgument):
        o80.robots.load("two_joints").inline(gain="heavy")


def own_backend(segment: str) -> None:
    with o80.Backend(f"{segment}-own", ["a"], history=64, lanes=1, lane_blocks=64) as backend:
        backend.publish([0.0])


def inline(segment: str) -> None:
    with o80.robots.load("two_joints").inline(f"{segment}-own", history=64) as arm:
        arm.burst(1)


@pytest.mark.filterwarnings("ignore::ResourceWarning")
@pytest.mark.parametrize(
    ("use", "times"),
    [(command, 1000), (drop_all, 60), (fail_half_way, 15), (own_backend, 100), (inline, 15)],
)
def test_many_of_them_leave_nothing(
    standing: o80.Backend, use: Callable[[str], None], times: int
) -> None:
    for _ in range(3):
        use(standing.segment)
    drain(standing)
    before = held()

    for _ in range(times):
        use(standing.segment)
        drain(standing)

    assert held() == before


def drain(backend: o80.Backend) -> None:
    """Does all that was asked, so that the lanes stay empty."""
    try:
        while (desired := backend.step(0.0)) is not None:
            backend.publish(desired)
    except o80.TimeoutError:
        pass


def test_a_cycle_of_a_backend_and_its_handler_is_collected(segment: str) -> None:
    backend = o80.Backend(segment, ["a"], requests={"home": None})
    backend.on("home", lambda _fields: backend.interrupt(0))  # noqa: F821, it is deleted below
    seen = weakref.ref(backend)

    del backend
    gc.collect()

    assert seen() is None
    assert segment not in [entry.name for entry in o80.segments() if entry.alive]


def test_a_stream_keeps_its_frontend(standing: o80.Backend) -> None:
    rows = o80.Frontend(standing.segment).stream(since=0)
    gc.collect()

    with pytest.raises(o80.Closed):  # the frontend was collected, which closes it
        next(rows)


def test_arrays_outlive_what_they_were_read_from(segment: str) -> None:
    with o80.robots.load("two_joints").inline(segment) as arm:
        arm.add_command(0, 0.5, iterations=10)
        arm.burst(10)
        last = arm.latest().desired
        rows = arm.history().desired
        record = arm.latest().extended
        first = arm.initial_states
    del arm
    gc.collect()
    np.full(1 << 20, 7.0)  # what was let go of would be written over

    assert last.tolist() == [0.5, 0.0]
    assert rows[:, 0].tolist() == pytest.approx([i / 20 for i in range(11)])
    assert len(record) >= 0
    assert first.tolist() == [0.0, 0.0]


def test_an_inline_robot_that_is_dropped_stops_and_its_watchers_are_told(segment: str) -> None:
    arm = o80.robots.load("two_joints").inline(segment)
    arm.burst(3)
    with o80.Frontend(segment, read_only=True) as watcher:
        with pytest.warns(ResourceWarning, match="never closed"):
            del arm
        with pytest.raises(o80.BackendStopped):
            watcher.wait_for(10, WAIT)
        assert watcher.history().iteration.tolist() == [0, 1, 2, 3]


def test_objects_may_be_referred_to_weakly(arm: o80.Frontend) -> None:
    assert weakref.ref(arm)() is arm


WATCHED = """
import o80, o80._core
o80._core._warn_of_leaks()
with o80.Backend("{name}", ["a"], requests={{"home": None}}) as backend:
    backend.on("home", lambda fields: None)
    backend.publish([0.0])
    with o80.Frontend("{name}") as frontend:
        frontend.add_command(0, 1.0)
        batch = frontend.pulse()
        observation, rows, history = frontend.latest(), frontend.stream(), frontend.history()
        handles = batch.handles
with o80.robots.load("two_joints").inline() as arm:
    burst = arm.burst(3, wait=False)
"""


def test_python_that_watches_itself_finds_no_leak(segment: str) -> None:
    assert run_python("-X", "dev", "-c", WATCHED.format(name=segment)).stderr == ""


def test_what_a_program_keeps_until_its_end_is_not_called_a_leak() -> None:
    program = "import o80; o80.Frontend.kept = o80.robots.load('two_joints').inline()"
    assert "nanobind" not in run_python("-X", "dev", "-c", program).stderr
