"""The supervisor of the lab: it tells who ended and why, and leaves nothing, however it ends."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import o80
from o80_table_tennis.lab.parts import COMMAND, Part
from o80_table_tennis.lab.processes import PartEndedError, Processes

WAITING = 30.0
"""For what takes milliseconds on a quiet machine [s]."""


def program(name: str, text: str, says: str = "") -> Part:
    return Part(name, (sys.executable, "-u", "-c", text), says=says)


ASLEEP = program("asleep", "import time; print('up'); time.sleep(1e4)", "up")
BROKEN = program("broken", "print('loading'); print('no such arm'); raise SystemExit(3)", "up")


def robot(name: str) -> Part:
    segment = f"lab-test-{os.getpid()}-{name}"
    return Part(name, (COMMAND, "run", "two_joints", f"--segment={segment}"), segment)


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Callable[..., Processes]]:
    made: list[Processes] = []

    def make(*parts: Part) -> Processes:
        made.append(Processes(parts, tmp_path))
        return made[-1]

    yield make
    for each in made:
        each.close()


def wait_until(holds: Callable[[], bool]) -> None:
    end = time.monotonic() + WAITING
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.01)


def lives(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def test_a_process_that_ends_at_its_start_is_named_with_its_last_lines(
    lab: Callable[..., Processes],
) -> None:
    processes = lab(ASLEEP, BROKEN)
    processes.start()
    with pytest.raises(PartEndedError, match="'broken' ended with exit code 3") as caught:
        processes.wait_until_running(WAITING)
    assert caught.value.lines == ["loading", "no such arm"]


def test_what_does_not_run_in_time_is_named_with_its_last_lines(
    lab: Callable[..., Processes],
) -> None:
    silent = Part("silent", ASLEEP.command, says="never")
    processes = lab(silent)
    processes.start()
    with pytest.raises(o80.TimeoutError, match="do not run yet:\n'silent': "):
        processes.wait_until_running(0.3)


def test_a_killed_process_is_told_and_can_be_started_again(lab: Callable[..., Processes]) -> None:
    processes = lab(robot("left"), robot("right"))
    processes.start("right", "left")
    processes.wait_until_running(WAITING)
    os.kill(processes.running["left"].pid, signal.SIGKILL)
    assert processes.ended(WAITING) == ["left"]
    assert "was killed by SIGKILL" in str(processes.collected("left"))
    assert list(processes.running) == ["right"]
    processes.start("left")
    processes.wait_until_running(WAITING)
    with o80.Frontend(processes.parts["left"].segment or "") as left:
        left.wait_for_next(timeout=WAITING)


def test_closing_ends_all_and_removes_the_segments_of_killed_ones(
    lab: Callable[..., Processes],
) -> None:
    processes = lab(robot("left"), robot("right"), ASLEEP)
    processes.start()
    processes.wait_until_running(WAITING)
    pids = [each.pid for each in processes.running.values()]
    os.kill(processes.running["left"].pid, signal.SIGKILL)
    processes.close()
    assert not any(lives(pid) for pid in pids)
    assert not [each for each in o80.segments() if each.name.startswith("lab-test-")]


def test_the_last_of_the_table_ends_first(lab: Callable[..., Processes], tmp_path: Path) -> None:
    text = (
        "import signal, sys, time\n"
        "def end(*_): open({file!r}, 'a').write({name!r} + ' '); sys.exit()\n"
        "signal.signal(signal.SIGTERM, end); print('up'); time.sleep(1e4)"
    )
    file = tmp_path / "order"
    names = ("world", "cameras", "tracker")
    processes = lab(
        *(program(name, text.format(file=str(file), name=name), "up") for name in names)
    )
    processes.start(*reversed(names))
    processes.wait_until_running(WAITING)
    processes.close()
    assert file.read_text().split() == ["tracker", "cameras", "world"]


SUPERVISOR = """
import sys, time
from pathlib import Path
sys.path.insert(0, {tests!r})
from test_lab_processes import ASLEEP, WAITING, robot
from o80_table_tennis.lab.processes import Processes
from o80_table_tennis.ending import ends_in_order

with ends_in_order(), Processes([robot("arm"), ASLEEP], Path({folder!r})) as processes:
    processes.start()
    processes.wait_until_running(WAITING)
    print(*[each.pid for each in processes.running.values()], flush=True)
    while True:
        processes.ended(0.5)
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_nothing_remains_however_the_supervisor_ends(
    number: signal.Signals, tmp_path: Path
) -> None:
    text = SUPERVISOR.format(tests=str(Path(__file__).parent), folder=str(tmp_path))
    supervisor = subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE)
    assert supervisor.stdout is not None
    try:
        pids = [int(word) for word in supervisor.stdout.readline().split()]
        assert len(pids) == 2
        supervisor.send_signal(number)
        supervisor.wait(WAITING)
    finally:
        supervisor.kill()
        supervisor.wait()
        supervisor.stdout.close()
    wait_until(lambda: not any(lives(pid) for pid in pids))
    assert not list(Path(os.environ["O80_DIRECTORY"]).glob("o80-lab-test-*"))
