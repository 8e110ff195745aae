"""Promise of every test session: it leaves no process and no shared memory behind."""

import contextlib
import os
import shutil
import signal
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import pytest
from hypothesis import HealthCheck, settings

from sources import all_left_to_check

os.environ.setdefault("HYPOTHESIS_STORAGE_DIRECTORY", "build/hypothesis")
# an example may take as long as a slow machine needs
settings.register_profile("o80", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("o80")
# a run in the background may have been started with interrupts ignored, and would pass it on
signal.signal(signal.SIGINT, signal.default_int_handler)

ROOT = Path(__file__).resolve().parent
DATA = Path(os.environ.get("O80_DATA", ROOT.parent / "shared" / "data"))  # recordings
GRACE = 5.0  # [s] for the last to die

Found = TypeVar("Found", int, Path)


def remove_own_and_dead() -> None:
    """The directory of this process, and those whose process has ended: it may have been killed."""
    for old in Path("/dev/shm").glob("pytest-o80-*"):
        process = old.name.rpartition("-")[2]
        if process == str(os.getpid()) or not Path("/proc", process).exists():
            shutil.rmtree(old, ignore_errors=True)


def own_directory() -> Path:
    """A directory for the segments of this process: other test runs and robots use their own."""
    remove_own_and_dead()
    made = Path(f"/dev/shm/pytest-o80-{os.getpid()}")
    made.mkdir()
    return made


DIRECTORY = own_directory()
os.environ["O80_DIRECTORY"] = str(DIRECTORY)  # all that is started here inherits it


def pytest_unconfigure() -> None:
    # a worker that takes long to end on a slow machine is killed by its controller
    remove_own_and_dead()


# names of tests that were left out: for their mark or name, and for want of recordings
deselected: set[str] = set()
without_recordings: set[str] = set()
# files of which all tests have the mark `check`
left_files: set[str] = set()


ONLY_CHECK = {"rerun", "stable_baselines3", "torch"}  # what it installs alone


class NotInstalled:
    """Finder that refuses the modules of ONLY_CHECK: `make test` fails here as in a new .venv."""

    def find_spec(self, name: str, *_: object) -> None:
        if name.partition(".")[0] in ONLY_CHECK:
            raise ModuleNotFoundError(f"No module named {name!r}: `make check` has it", name=name)


def pytest_configure(config: pytest.Config) -> None:
    if config.option.markexpr == "not check":
        sys.meta_path.insert(0, NotInstalled())


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """`make test` does not read such a file: it may import what only `make check` installs."""
    if config.option.markexpr != "not check" or not collection_path.match("test_*.py"):
        return None
    if all_left_to_check(collection_path):
        left_files.add(str(collection_path))
        return True
    return None


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Tests of recordings are left out where these are not there."""
    missing = []
    for item in items:
        mark = item.get_closest_marker("recordings")
        if mark is not None and not (DATA / mark.args[0]).is_dir():
            missing.append(item)
    if missing:
        without_recordings.update(item.nodeid for item in missing)
        config.hook.pytest_deselected(items=missing)
        items[:] = [item for item in items if item not in missing]


def pytest_deselected(items: list[pytest.Item]) -> None:
    deselected.update(item.nodeid for item in items)


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Workers of pytest-xdist tell the session what they left out."""
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput["deselected"] = sorted(deselected)
        session.config.workeroutput["without_recordings"] = sorted(without_recordings)
        session.config.workeroutput["left_files"] = sorted(left_files)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    output = getattr(node, "workeroutput", {})
    deselected.update(output.get("deselected", ()))
    without_recordings.update(output.get("without_recordings", ()))
    left_files.update(output.get("left_files", ()))


def pytest_terminal_summary(terminalreporter: Any) -> None:
    say = terminalreporter.write_line
    if terminalreporter.config.option.markexpr == "not check":
        count = len(deselected - without_recordings)
        say(f"left to make check: {count} tests in Python, and {len(left_files)} whole files")
    if without_recordings:
        count = len(without_recordings)
        say(f"left out: {count} tests of recordings, which are not in {DATA} (O80_DATA)")


def segment_files() -> set[Path]:
    """Files in that directory."""
    return set(DIRECTORY.iterdir())


def told_of(path: Path) -> str:
    """Text of the kernel about a process or thread; empty if that has ended."""
    try:
        return path.read_bytes().decode(errors="replace")
    except OSError:
        return ""


def command_line(process: int) -> str:
    """The words a process was started with."""
    return told_of(Path(f"/proc/{process}/cmdline")).replace("\0", " ")


def lives(process: int) -> bool:
    """Whether the process still runs: a zombie does not."""
    words = told_of(Path(f"/proc/{process}/stat")).rpartition(")")[2].split()
    return bool(words) and words[0] not in "ZX"


def children() -> set[int]:
    """Living child processes of all threads of this one, but for Python's own."""
    found = {
        int(child)
        for task in Path("/proc/self/task").iterdir()
        for child in told_of(task / "children").split()
    }
    own = {child for child in found if "multiprocessing.resource_tracker" in command_line(child)}
    return {child for child in found - own if lives(child)}


def relatives() -> set[int]:
    """Our children, and who was started for a segment of this session by one of them."""
    own = f"test-{os.getpid()}-"
    everybody = {int(folder.name) for folder in Path("/proc").glob("[0-9]*")}
    return children() | {p for p in everybody if own in command_line(p) and lives(p)}


def left_over(found: Callable[[], set[Found]], before: set[Found]) -> list[Found]:
    """Findings that were not there before, once ending processes have ended."""
    end = time.monotonic() + GRACE
    while (rest := found() - before) and time.monotonic() < end:
        time.sleep(0.05)
    return sorted(rest)


@pytest.fixture(scope="session", autouse=True)
def nothing_left_behind() -> Iterator[None]:
    processes = children()
    yield
    living = left_over(children, processes)
    commands = [command_line(process) for process in living]
    # a robot that never starts outlives who was interrupted twice while starting it
    for process in relatives() - processes:
        with contextlib.suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)
    files = left_over(segment_files, set())
    assert not commands, f"the tests left processes behind: {commands}"
    assert not files, f"the tests left shared memory behind: {files}"


@pytest.fixture(scope="session")
def build_prefix() -> Path:
    """The build folder of the preset dev, laid out like an installation (bin, lib)."""
    prefix = ROOT / "build" / "dev"
    if not (prefix / "lib" / "libo80.so").exists():
        pytest.fail("the programs of the preset dev are not built: make test ARGS=processes")
    return prefix
