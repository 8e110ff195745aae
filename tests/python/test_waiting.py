"""Every call that waits: Ctrl-C ends it, and other threads run on meanwhile."""

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

import o80

WAIT = 30.0  # [s] longer than any wait should take

# what blocks for ever, in a program that was given a frontend `arm`
CALLS = {
    "wait_for": "arm.wait_for(10**12)",
    "wait_for_next": "standing.wait_for_next()",
    "stream": "[None for _ in standing.stream()]",
    "pulse_and_wait": "arm.add_command(0, 1.0, duration=1e6); arm.pulse_and_wait()",
    "batch.wait": "arm.add_command(0, 1.0, duration=1e6); arm.pulse().wait()",
    "burst": "slow.burst(10**12)",
    "group": "o80.burst({slow: 10**12})",
    "burst.wait": "slow.burst(10**12, wait=False).wait()",
    "inline": "standing.burst(10**12)",
    "attach": "o80.Frontend('nobody-has-this-name', timeout=None)",
    "step": "backend.step()",
    "process.wait": "process.wait()",
}
PROGRAM = """
import sys, o80
joints = o80.robots.load("two_joints")
with (
    joints.start("{name}-a") as process,
    joints.start("{name}-b", bursting=True, frequency=1.0) as burster,
    process.frontend() as arm,
    burster.frontend() as slow,
    joints.inline("{name}-c") as standing,
    o80.Backend("{name}-d", ["a"], bursting=True) as backend,
):
    backend.publish([0.0])
    sys.stdout.write("ready\\n")
    sys.stdout.flush()
    try:
        {call}
    except KeyboardInterrupt:
        sys.stdout.write("interrupted\\n")
        sys.stdout.flush()
        raise
"""


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS.keys())
def test_ctrl_c_ends_every_wait(segment: str, call: str) -> None:
    program = subprocess.Popen(
        [sys.executable, "-c", PROGRAM.format(name=segment, call=call)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert program.stdout is not None
    assert program.stdout.readline() == "ready\n"

    # the signal may come before the call begins: either way it ends by it
    program.send_signal(signal.SIGINT)
    output, errors = program.communicate(timeout=WAIT)

    assert output in ("interrupted\n", ""), errors
    assert "KeyboardInterrupt" in errors
    assert program.returncode == -signal.SIGINT
    for suffix in "acd":
        assert not (Path("/dev/shm") / f"o80-{segment}-{suffix}").exists()


def test_an_inline_burst_that_was_interrupted_is_not_gone_on_with(arm: o80.Frontend) -> None:
    def interrupt(_signal: int, _frame: object) -> None:
        raise InterruptedError

    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.001)
        with pytest.raises(InterruptedError):
            arm.burst(10**12)
    finally:
        signal.signal(signal.SIGALRM, before)
    reached = arm.published

    assert arm.burst(1).iteration == reached + 1


def test_a_signal_whose_handler_raises_nothing_does_not_end_a_wait(
    process: o80.robots.Process,
) -> None:
    heard = []
    before = signal.signal(signal.SIGALRM, lambda *_: heard.append(1))
    try:
        with process.frontend() as arm:
            signal.setitimer(signal.ITIMER_REAL, 0.001)
            while not heard:
                arm.wait_for(arm.published + 5, timeout=WAIT)
    finally:
        signal.signal(signal.SIGALRM, before)


def test_other_threads_run_while_one_waits(arm: o80.Frontend) -> None:
    rows: list[int] = []
    waiting = threading.Thread(target=lambda: rows.append(arm.wait_for(3, WAIT).iteration))
    waiting.start()

    arm.burst(5)  # would never be reached if the wait held the interpreter
    waiting.join(WAIT)

    assert rows == [3]


def test_closing_a_frontend_ends_the_waits_of_other_threads(process: o80.robots.Process) -> None:
    raised: list[BaseException] = []
    arm = process.frontend()
    begun = threading.Event()

    def wait() -> None:
        begun.set()
        try:
            arm.wait_for(10**12, timeout=WAIT)
        except o80.Closed as error:
            raised.append(error)

    waiting = threading.Thread(target=wait)
    waiting.start()
    begun.wait(WAIT)
    arm.close()
    waiting.join(WAIT)

    assert len(raised) == 1


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
