"""Many threads of one process, each in a call that waits."""

import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from blocking import CALLS, Place, place, waiting_methods
from processes import WAIT, Running, run_python

import o80


@pytest.fixture
def here(segment: str, tmp_path: Path) -> Iterator[Place]:
    with place(segment, tmp_path) as made:
        yield made


class Waiting(threading.Thread):
    """A thread in a call; keeps what it gave or raised."""

    def __init__(self, source: str, names: dict[str, Any]) -> None:
        super().__init__(daemon=True)
        self.source = source
        self.names = names
        self.begun = threading.Event()
        self.given: Any = None
        self.raised: BaseException | None = None
        self.start()

    def run(self) -> None:
        self.begun.set()
        try:
            self.given = eval(self.source, self.names)
        except BaseException as error:
            self.raised = error


def count_up() -> int:
    """Python goes on, which it would not if a thread that waits kept the interpreter."""
    counted = 0
    for _ in range(300_000):
        counted += 1
    return counted


def ended(threads: list[Waiting]) -> list[str]:
    """Joins them; the sources of those that did not end."""
    for thread in threads:
        thread.join(WAIT)
    return [thread.source for thread in threads if thread.is_alive()]


def test_every_call_that_takes_a_timeout_is_known_to_these_tests() -> None:
    known = {name.partition(",")[0].partition(" of")[0] for name in CALLS}
    assert waiting_methods() == known


RESULTS: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "Frontend": ("o80.Frontend(late, None).published", lambda row: row == 0),
    "wait_for": ("silent.wait_for(50).iteration", lambda row: row == 50),
    "wait_for_next": ("silent.wait_for_next().iteration", lambda row: row >= 1),
    "stream": (
        "[next(rows).iteration for rows in [silent.stream(since=0)] for _ in range(60)]",
        lambda rows: rows == list(range(60)),
    ),
    "a reader's stream": (
        "[next(rows).iteration for rows in [reader.stream(since=0)] for _ in range(60)]",
        lambda rows: rows == list(range(60)),
    ),
    "pulse_and_wait": (
        "(silent.add_command('a', 0.5, iterations=20), silent.pulse_and_wait())[1].desired[0]",
        lambda state: state == 0.5,
    ),
    "pulse_and_wait, bursting": (
        "(standing.add_command('b', 0.5, iterations=20), standing.pulse_and_wait())[1].desired[1]",
        lambda state: state == 0.5,
    ),
    "request": ("silent.request('home')", lambda nothing: nothing is None),
    "burst": ("standing.burst(7).iteration", lambda row: row >= 7),
    "burst, inline": ("inline.burst(2000).iteration", lambda row: row == 2000),
    "group": ("o80.burst({standing: 9})[standing].iteration", lambda row: row >= 9),
    "PreparedBurst.run": (
        "[(b.targets.fill(0.5), b.run())[1] for b in [standing.prepared_burst(4)]][0]",
        lambda row: row >= 4,
    ),
    "BurstGroup.wait": (
        "o80.burst({standing: 9}, wait=False).wait()[standing].iteration",
        lambda row: row >= 9,
    ),
    "Burst.wait": ("standing.burst(3, wait=False).wait().iteration", lambda row: row >= 3),
    "Batch.wait": (
        "[(b.wait(), b.statuses) for b in [(silent.add_command('b', 0.5), silent.pulse())[1]]]",
        lambda waited: waited == [(None, ["completed"])],
    ),
    "reattach": ("(gone.reattach(None), gone.life)[1]", lambda life: life == "running"),
    "step": ("float(stepping.step()[0])", lambda state: state == 0.25),
    "Process.wait": ("process.wait()", lambda code: code == 0),
    "Process.frontend": ("unborn.frontend(None).alive", lambda alive: alive),
}


@pytest.mark.parametrize("shared", [False, True], ids=["objects of their own", "shared objects"])
def test_many_threads_wait_at_once_and_each_gets_its_result(here: Place, shared: bool) -> None:
    threads = {}
    for name, (source, _) in RESULTS.items():
        if not shared:
            here.open_frontends()
        threads[name] = Waiting(source, here.names())
    for thread in threads.values():
        assert thread.begun.wait(WAIT)
    assert count_up() == 300_000
    assert len(threads) >= 16

    # now comes what they wait for
    here.begin(here.late)
    here.begin(here.unborn.segment)
    here.begin(here.gone.segment)
    here.process.stop()
    with o80.Frontend(here.stepping.segment) as other:
        other.add_command(0, 0.25)
        other.burst(1, wait=False)
        standing = threading.Thread(target=iterate, args=(here.standing_backend,))
        standing.start()
        silent = here.silent_backend
        while any(thread.is_alive() for thread in threads.values()):
            desired = silent.step()
            silent.publish(desired)
            if silent.iteration % 100 == 0:  # all else is done, or the history would be over
                threads["stream"].join(0.01)
        here.standing_backend.stop()
        standing.join(WAIT)

    raised = {name: thread.raised for name, thread in threads.items() if thread.raised}
    assert not raised
    for name, (_, is_right) in RESULTS.items():
        given = threads[name].given
        if shared and ("pulse" in name or name == "Batch.wait"):
            continue  # another thread's pulse or burst may have sent what this one had added
        assert is_right(given), f"{name} gave {given}"


def iterate(backend: o80.Backend) -> None:
    while (desired := backend.step()) is not None:
        backend.publish(desired)


def test_closing_from_another_thread_ends_every_call(here: Place) -> None:
    threads = {}
    for name, call in CALLS.items():
        here.open_frontends()
        threads[name] = Waiting(call.source, here.names())
    for thread in threads.values():
        assert thread.begun.wait(WAIT)
    assert count_up() == 300_000
    assert all(thread.is_alive() for thread in threads.values())

    for name, call in CALLS.items():
        exec(call.closing, threads[name].names)

    assert ended([*threads.values()]) == []
    for name, call in CALLS.items():
        raised = threads[name].raised
        assert type(raised).__name__ == (call.raises or "NoneType"), f"{name}: {raised!r}"
        if call.raises == "Closed":
            assert "was closed" in str(raised), name


BACKENDS = """
import sys, o80
silent = o80.Backend({name!r} + "-silent", ["a", "b"], requests={{"home": None}}, lanes=32)
standing = o80.Backend({name!r} + "-standing", ["a", "b"], bursting=True, lanes=32)
silent.publish([0.0, 0.0])
standing.publish([0.0, 0.0])
print("ready", flush=True)
exec(sys.stdin.readline())
"""
ENDS = {
    "BackendStopped": "silent.close(); standing.close()",
    "BackendFailed": "silent.close('it broke'); standing.close('it broke')",
    "BackendKilled": "import os; os.kill(os.getpid(), 9)",
}


# rule O9
@pytest.mark.parametrize("error", ENDS)
def test_the_end_of_a_backend_ends_every_wait_of_sixteen_threads(segment: str, error: str) -> None:
    sources = [call.source for call in CALLS.values() if call.closing.startswith(("sil", "sta"))]
    with Running(sys.executable, "-c", BACKENDS.format(name=segment)) as program:
        assert program.stdout.readline() == "ready\n"
        threads = []
        opened = []
        for i in range(16):
            silent = o80.Frontend(f"{segment}-silent")
            standing = o80.Frontend(f"{segment}-standing")
            opened += [silent, standing]
            names = {"o80": o80, "silent": silent, "standing": standing}
            threads.append(Waiting(sources[i % len(sources)], names))
        for thread in threads:
            assert thread.begun.wait(WAIT)
        assert count_up() == 300_000

        program.stdin.write(ENDS[error] + "\n")
        program.stdin.flush()
        assert ended(threads) == []
        program.communicate(timeout=WAIT)

    for thread in threads:
        raised = thread.raised
        assert type(raised).__name__ == error, f"{thread.source}: {raised!r}"
        assert segment in str(raised)
    for frontend in opened:
        assert f"Backend{frontend.life.title()}" == error
        frontend.forget_added()
        frontend.close()
    for suffix in ("silent", "standing"):
        o80.clean(f"{segment}-{suffix}")


def test_what_threads_add_and_pulse_at_once_is_sent_once(
    arm: o80.Frontend,
) -> None:
    batches: list[o80.Batch] = []
    done: list[int] = []

    def send(times: int) -> None:
        for _ in range(times):
            arm.add_trajectory([[0.1, 0.2], [0.3, 0.4]])
            batches.append(arm.pulse())
        done.append(times)

    threads = [threading.Thread(target=send, args=(300,)) for _ in range(4)]
    for thread in threads:
        thread.start()
    for _ in range(300):
        arm.add_trajectory([[0.5, 0.6]])
        batches.append(arm.burst(1, wait=False).batch)
    for thread in threads:
        thread.join(WAIT)
    batches.append(arm.pulse())

    assert done == [300] * 4
    assert arm.added == 0
    assert sum(len(batch) for batch in batches) == 5 * 300


def test_a_backend_is_used_by_one_thread(here: Place) -> None:
    thread = Waiting("stepping.step()", here.names())
    assert thread.begun.wait(WAIT)

    refused = None
    while refused is None and thread.is_alive():
        try:
            here.stepping.publish([0.0])  # until it is in step
        except o80.Error as error:
            refused = error
    assert "inside step" in str(refused)
    here.stepping.stop()

    assert ended([thread]) == []
    assert thread.raised is None
    assert thread.given is None


def test_a_handler_may_close_its_backend_but_not_publish(segment: str) -> None:
    refused: list[BaseException] = []
    with o80.Backend(segment, ["a"], requests={"home": None, "leave": None}) as backend:
        backend.publish([0.0])

        def home(_fields: o80.Record) -> None:
            with pytest.raises(o80.Error, match="inside step") as raised:
                backend.publish([1.0])
            refused.append(raised.value)

        backend.on("home", home)
        backend.on("leave", lambda _fields: backend.close())
        with o80.Frontend(segment) as other:
            other.add_request("home")
            other.add_request("leave")
            other.pulse()
            with pytest.raises(o80.Closed, match="in step"):
                backend.step()
            with pytest.raises(o80.BackendStopped):
                other.wait_for(10, WAIT)
    assert len(refused) == 1


def test_all_of_this_holds_where_python_watches_itself() -> None:
    watched = ["-X", "dev", "-X", "faulthandler", "-m", "pytest", "-q", __file__]
    run = run_python(*watched, "-k", "shared or closing or BackendKilled or handler", timeout=250)

    assert "Fatal" not in run.stderr
