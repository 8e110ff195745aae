"""Waits and what ends them: results, signals, deaths. Ctrl-C in each call is in test_signals."""

import os
import signal
import threading
import time
from pathlib import Path

import pytest
from alarm import alarm_in

import o80

WAIT = 30.0  # [s] longer than any wait should take


def test_an_inline_burst_that_was_interrupted_is_not_gone_on_with(arm: o80.Frontend) -> None:
    def interrupt(_signal: int, _frame: object) -> None:
        raise InterruptedError

    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        with pytest.raises(InterruptedError), alarm_in(0.001):
            arm.burst(10**12)
    finally:
        signal.signal(signal.SIGALRM, before)
    reached = arm.published

    assert arm.burst(1).iteration == reached + 1


def test_other_threads_run_while_one_waits(arm: o80.Frontend) -> None:
    rows: list[int] = []
    waiting = threading.Thread(target=lambda: rows.append(arm.wait_for(3, WAIT).iteration))
    waiting.start()

    arm.burst(5)  # would never be reached if the wait held the interpreter
    waiting.join(WAIT)

    assert rows == [3]


def test_many_threads_share_one_frontend(process: o80.robots.Process) -> None:
    with process.frontend() as arm:
        batches: list[o80.Batch] = []
        failed: list[BaseException] = []

        def command(actuator: int) -> None:
            try:
                for i in range(50):
                    arm.add_command(actuator, i / 100)
                    batches.append(arm.pulse())
                    arm.latest()
                    arm.history(10)
            except BaseException as error:
                failed.append(error)

        threads = [threading.Thread(target=command, args=(i % 2,)) for i in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(WAIT)

        assert not failed
        for batch in batches:
            batch.wait(WAIT)
        assert sum(len(batch) for batch in batches) == 200
        ends = {o80.Status.COMPLETED, o80.Status.OVERWRITTEN}
        assert {status for batch in batches for status in batch.statuses} <= ends


# ---------------------------------------------------------------------------- deaths


def test_a_killed_backend_is_an_error_and_its_history_stays(
    process: o80.robots.Process,
) -> None:
    arm = process.frontend()
    arm.wait_for(20, timeout=WAIT)
    raised: list[BaseException] = []

    def wait() -> None:
        try:
            arm.wait_for(10**12, timeout=WAIT)
        except o80.Error as error:
            raised.append(error)

    waiting = threading.Thread(target=wait)
    waiting.start()
    os.kill(process.pid, signal.SIGKILL)
    waiting.join(WAIT)

    assert isinstance(raised[0], o80.BackendKilled)
    assert process.segment in str(raised[0])
    assert arm.life == "killed"
    assert not arm.alive
    history = arm.history()
    assert history.iteration.tolist() == list(range(arm.oldest, arm.published + 1))
    assert len(history) > 20
    arm.add_command(0, 1.0)
    with pytest.raises(o80.BackendKilled):
        arm.pulse()
    arm.forget_added()
    with o80.Frontend(process.segment, dead=True) as late:
        assert late.published == arm.published
    arm.close()


def test_a_killed_backend_ends_the_wait_for_a_burst(bursting: o80.robots.Process) -> None:
    with bursting.frontend() as arm:
        burst = arm.burst(10**12, wait=False)
        os.kill(bursting.pid, signal.SIGKILL)

        with pytest.raises(o80.BackendKilled):
            burst.wait(WAIT)


def test_a_killed_backend_ends_a_batch(process: o80.robots.Process) -> None:
    with process.frontend() as arm:
        arm.add_command(0, 1.0, duration=1000.0)
        batch = arm.pulse()
        os.kill(process.pid, signal.SIGKILL)

        with pytest.raises(o80.BackendKilled):
            batch.wait(WAIT)


def test_a_killed_name_is_taken_over_without_cleaning(segment: str) -> None:
    robot = o80.robots.load("two_joints")
    with robot.start(segment) as first:
        os.kill(first.pid, signal.SIGKILL)
        first.wait(WAIT)
        with pytest.raises(o80.TimeoutError):
            o80.Frontend(segment, timeout=0.01)
        with robot.start(segment) as second, second.frontend() as arm:
            assert arm.alive


def test_who_is_attached_learns_of_a_kill_and_goes_on_with_the_next_backend(segment: str) -> None:
    robot = o80.robots.load("two_joints")
    with robot.start(segment) as first:
        arm = first.frontend()
        arm.wait_for(3, WAIT)
        os.kill(first.pid, signal.SIGKILL)
        with pytest.raises(o80.BackendKilled, match=f"'{segment}'.*pid {first.pid}.* was killed"):
            arm.wait_for(10**12, WAIT)
    with robot.start(segment) as second:
        with pytest.raises(o80.BackendSuperseded, match="a new one has its name: attach again"):
            arm.wait_for(10**12, WAIT)
        arm.reattach(WAIT)
        arm.add_command(0, 0.5)
        assert arm.pulse_and_wait(WAIT).desired[0] == 0.5
        assert second.pid != first.pid
        arm.close()


def is_suspended(pid: int) -> bool:
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "T"


def test_a_suspended_backend_is_not_dead(process: o80.robots.Process) -> None:
    with process.frontend() as arm:
        arm.wait_for(3, WAIT)
        arm.add_command(0, 1.0, duration=1000.0)
        batch = arm.pulse()
        os.kill(process.pid, signal.SIGSTOP)
        try:
            while not is_suspended(process.pid):
                time.sleep(0.001)
            for wait in (
                lambda: arm.wait_for(10**12, timeout=0.1),
                lambda: [None for _ in arm.stream(timeout=0.1)],
                lambda: batch.wait(timeout=0.1),
            ):
                with pytest.raises(o80.TimeoutError):
                    wait()
            assert arm.life == "running"
            with pytest.raises(o80.SegmentTaken, match=f"pid {process.pid}"):
                o80.Backend(process.segment, ["a"])
        finally:
            os.kill(process.pid, signal.SIGCONT)
        arm.wait_for(arm.published + 3, WAIT)
        arm.purge()


def test_dead_segments_are_listed_and_cleaned(segment: str) -> None:
    with o80.robots.load("two_joints").start(segment) as process:
        alive = next(entry for entry in o80.segments() if entry.name == segment)
        assert (alive.alive, alive.pid, alive.life) == (True, process.pid, "running")
        assert alive.bytes > 0
        with pytest.raises(o80.SegmentTaken):
            o80.clean(segment)
        os.kill(process.pid, signal.SIGKILL)
        process.wait(WAIT)

        dead = next(entry for entry in o80.segments() if entry.name == segment)
        assert (dead.alive, dead.life, dead.epoch) == (False, "killed", alive.epoch)
        assert o80.clean(segment) == [segment]
        assert o80.clean(segment) == []


def test_a_timeout_carries_the_handles(arm: o80.Frontend) -> None:
    arm.add_command(0, 1.0, iterations=5)
    batch = arm.pulse()

    with pytest.raises(TimeoutError) as waited:
        batch.wait(0.0)
    with pytest.raises(o80.TimeoutError) as without_batch:
        arm.wait_for(10, timeout=0.0)

    assert isinstance(waited.value, o80.TimeoutError)
    assert [handle.status for handle in waited.value.handles] == [o80.Status.QUEUED]
    assert list(without_batch.value.handles) == []
