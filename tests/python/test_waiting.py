"""Waits and what ends them: results, signals, deaths. Ctrl-C in each call is in test_signals."""

import os
import signal
import threading

import pytest

import o80

WAIT = 30.0  # [s] longer than any wait should take


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
