"""Controllers in real time: `process.frontend(real_time=True)`, and the guard of its thread."""

import ast
import os

import pytest
from processes import run_python

import o80

TWO_CONTROLLERS = """
import os, subprocess, sys, threading, time, o80

ready, over = threading.Event(), threading.Event()
policies = {}

def waits(process):
    with process.frontend(real_time=True):
        ready.set()
        over.wait()
        ask = "import os; print(os.sched_getscheduler(0))"
        policies["child"] = subprocess.check_output([sys.executable, "-c", ask], text=True)
        policies["waits"] = os.sched_getscheduler(0), os.sched_getparam(0).sched_priority

def spins(process):
    with process.frontend(real_time=True) as arm:
        arm.wait_for_next()
        policies["before"] = os.sched_getscheduler(0), os.sched_getparam(0).sched_priority
        other = threading.Thread(target=waits, args=[process])
        other.start()
        ready.wait()
        end = time.monotonic() + 30
        while os.sched_getscheduler(0) & os.SCHED_FIFO and time.monotonic() < end:
            pass
        policies["after"] = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK, 0
        over.set()
        other.join()

robot = o80.robots.load("two_joints")
with robot.start(sys.argv[1], policy="fifo", priority=50) as process:
    controller = threading.Thread(target=spins, args=[process])
    controller.start()
    controller.join()
    policies["main"] = os.sched_getscheduler(0), 0
print(policies)
"""


def is_fifo_allowed() -> bool:
    tries = "import os; os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(50))"
    return run_python("-c", tries, code=None).returncode == 0


def test_a_controller_that_does_not_sleep_becomes_an_ordinary_thread_and_no_other(
    segment: str,
) -> None:
    if not is_fifo_allowed():
        pytest.skip("this user may not use the policy fifo")
    ran = run_python("-c", TWO_CONTROLLERS, segment)
    assert ast.literal_eval(ran.stdout) == {
        "before": (os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, 49),
        "after": (os.SCHED_OTHER, 0),
        "waits": (os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, 49),
        "child": "0\n",  # the guard is not inherited, so the policy is not
        "main": (os.SCHED_OTHER, 0),
    }
    assert "lost its real-time priority" in ran.stderr


def test_no_controller_gets_a_priority_above_that_of_the_loop(segment: str) -> None:
    with o80.robots.load("two_joints").start(segment, policy="auto") as process:
        assert "policy auto: other" in process.output, "it is simulated"
        with pytest.warns(RuntimeWarning, match="the loop has no real-time priority above 1"):
            process.frontend(real_time=True).close()
        assert os.sched_getscheduler(0) == os.SCHED_OTHER
