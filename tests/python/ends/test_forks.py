"""A process that forks inside a function that o80 calls: the child touches no robot."""

import pytest
from processes import run_python

START = """
import os, signal, sys, threading, time
import o80

children = []

def fork():
    if not children:
        sys.stdout.flush()
        children.append(os.fork())

def goes_on():
    "Once in the parent; the child must not come here."
    if children[0] == 0:
        print("the child went on", flush=True)
        os._exit(7)
    code = os.waitstatus_to_exitcode(os.waitpid(children[0], 0)[1])
    print("its child ended with", code, flush=True)
"""

DRIVER = """
class Forks:
    simulated = True
    def __init__(self):
        if sys.argv[2] == "constructor": fork()
    @property
    def actuators(self):
        if sys.argv[2] == "describe": fork()
        return ("joint",)
    def read(self, reading):
        pass

with o80.robots.load(Forks).inline(sys.argv[1]) as robot:
    goes_on()
    assert robot.burst(1).iteration == 1
"""

HANDLERS = """
with o80.Backend(sys.argv[1], ["joint"], requests={"home": None}) as backend:
    place = {"request": lambda handler: backend.on("home", lambda fields: handler()),
             "halt": backend.on_halt, "resume": backend.on_resume}[sys.argv[2]]
    place(fork)
    backend.publish([0.0])
    with o80.Frontend(sys.argv[1]) as frontend:
        if sys.argv[2] == "request":
            frontend.add_request("home")
            frontend.pulse()
        if sys.argv[2] in ("halt", "resume"):
            frontend.halt("test")
            for _ in range(2):
                backend.step()
                backend.publish()
        if sys.argv[2] == "resume":
            resumes = threading.Thread(target=frontend.resume)
            resumes.start()
            while not children:
                backend.step()
                backend.publish()
            resumes.join()
        else:
            backend.step()
            backend.publish()
        goes_on()
        assert frontend.alive
"""

SIGNALS = """
def forks_until_told(used):
    "`used` raises in the child, at once, if the signal came during it; else when it is used again."
    signal.signal(signal.SIGALRM, lambda number, frame: fork())
    signal.setitimer(signal.ITIMER_REAL, 0.05)
    while not children or children[0] == 0:
        try:
            used()
        except o80.UsedAfterFork:
            os._exit(3 if children == [0] else 4)
    goes_on()

robot = o80.robots.load("two_joints")
if sys.argv[2] == "step":
    with o80.Backend(sys.argv[1], ["joint"], bursting=True) as backend:
        backend.publish([0.0])
        def step():
            try:
                backend.step(0.5)
            except o80.TimeoutError:
                pass
        forks_until_told(step)
elif sys.argv[2] == "inline":
    with robot.inline(sys.argv[1]) as arm:
        forks_until_told(lambda: arm.burst(2000))
else:
    with robot.inline(copies=4, threads=int(sys.argv[2]), history=20000) as group:
        burst = group.prepared_burst(20000)
        burst.targets[...] = 0.5
        forks_until_told(burst.run)
"""


def run(program: str, segment: str, place: str) -> tuple[str, str]:
    """Standard output and error of a program with its children."""
    ended = run_python("-c", START + program, segment, place)
    return ended.stdout, ended.stderr


@pytest.mark.parametrize("place", ["constructor", "describe"])
def test_a_child_that_returns_from_the_making_of_a_driver_ends(segment: str, place: str) -> None:
    said, error = run(DRIVER, segment, place)
    assert said == "its child ended with 1\n"
    what = "its constructor" if place == "constructor" else place
    assert f"'forks' forked in {what}, and the child" in error
    assert "os._exit" in error


@pytest.mark.parametrize("place", ["request", "halt", "resume"])
def test_a_child_that_returns_from_a_handler_of_a_backend_ends(segment: str, place: str) -> None:
    said, error = run(HANDLERS, segment, place)
    assert said == "its child ended with 1\n"
    assert f"'{segment}' forked in the handler of a {place}, and the child" in error


@pytest.mark.parametrize("place", ["step", "inline", "1", "3"])
def test_a_child_forked_in_a_signal_handler_runs_no_iteration(segment: str, place: str) -> None:
    said, _ = run(SIGNALS, segment, place)
    assert said == "its child ended with 3\n"
