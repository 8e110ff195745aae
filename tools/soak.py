"""Repeats the tests of `make test` under conditions of a hostile machine.

Each round draws its conditions from the seed. Each failed test is printed with the
round and its conditions: `--seed S --first ROUND --rounds 1` repeats them. Logs: build/soak.
"""

import argparse
import contextlib
import os
import random
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from outcomes import Outcomes
from sources import ROOT
from steps import JOBS, Step, build, ctest, pytest, run, use_tools

FOLDER = ROOT / "build" / "soak"
GROUPS = Path("/sys/fs/cgroup")
NOBODY = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"]
# a grandchild tests the user's rights: `setpriv` may start a program that no user may read
STARTS = "import subprocess, sys; subprocess.run([sys.executable, '-c', ''], check=True)"
BURN = [sys.executable, "-c", "while True: pass"]
WRITE = """
import os, sys
while True:
    with open(sys.argv[1], "wb") as file:
        for _ in range(64):
            file.write(bytes(1 << 20))
            os.fsync(file.fileno())
"""


@dataclass
class Round:
    """Start options of a round's tests."""

    random: random.Random
    folder: Path
    prefix: list[str] = field(default_factory=list)  # words before each command
    environment: dict[str, str] = field(default_factory=dict)
    shuffled: bool = False
    runners: list[subprocess.Popen[bytes]] = field(default_factory=list)


Condition = Callable[[Round], contextlib.AbstractContextManager[None]]


@contextlib.contextmanager
def programs(*commands: list[str]) -> Iterator[None]:
    """Runs programs during the block."""
    running = [subprocess.Popen(command) for command in commands]
    try:
        yield
    finally:
        for process in running:
            process.kill()
            process.wait()


@contextlib.contextmanager
def processor(this: Round) -> Iterator[None]:
    chosen = this.random.choice(sorted(os.sched_getaffinity(0)))
    this.prefix += ["taskset", "-c", str(chosen)]
    yield


def busy(_: Round) -> contextlib.AbstractContextManager[None]:
    return programs(*[BURN] * (2 * JOBS))


@contextlib.contextmanager
def quota(this: Round) -> Iterator[None]:
    """Limits the tests to 30 % of each processor."""
    group = processor_groups() / f"o80-soak-{os.getpid()}"
    group.mkdir()
    try:
        if (group / "cpu.max").exists():
            (group / "cpu.max").write_text(f"{30_000 * JOBS} 100000")
        else:  # cgroups of version 1
            (group / "cpu.cfs_quota_us").write_text(str(30_000 * JOBS))
        enter = f'echo $$ > {group}/cgroup.procs && exec "$0" "$@"'
        this.prefix[:0] = ["sh", "-c", enter]
        yield
    finally:
        while left := (group / "cgroup.procs").read_text().split():
            for process in left:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(int(process), signal.SIGKILL)
            time.sleep(0.01)
        group.rmdir()


def processor_groups() -> Path:
    """Returns the folder of the processor's control groups."""
    return next((each for each in (GROUPS / "cpu", GROUPS) if each.is_dir()), GROUPS)


@contextlib.contextmanager
def order(this: Round) -> Iterator[None]:
    this.shuffled = True
    yield


@contextlib.contextmanager
def user(this: Round) -> Iterator[None]:
    """Runs the tests as an ordinary user, who owns the folders written by the runners."""
    this.prefix += NOBODY
    home = tempfile.mkdtemp(prefix="soak-home-")
    this.environment |= {"HOME": home, "PYTHONPYCACHEPREFIX": home}
    written = [this.folder, Path(home), *(ROOT / "build" / each for each in ("hypothesis", "test"))]
    written += [ROOT / "build/dev/Testing", ROOT / "build/pytest", ROOT / "build/mypy-users"]
    files = [ROOT / "build/mypy-users.lock", ROOT / "build/dev/install_manifest.txt"]
    for path in written:
        path.mkdir(parents=True, exist_ok=True)
    for path in files:
        path.touch()
    written += files
    for path in written:
        subprocess.run(["chown", "-R", "65534", path], check=True)
    try:
        yield
    finally:
        for path in written[2:]:
            subprocess.run(["chown", "-R", "0", path], check=True)
        shutil.rmtree(home, ignore_errors=True)


@contextlib.contextmanager
def zone(this: Round) -> Iterator[None]:
    """Sets another time zone, and a language with decimal commas if one is installed."""
    listed = subprocess.run(["locale", "-a"], capture_output=True, text=True, check=False).stdout
    others = [each for each in listed.split() if each.startswith(("de_", "fr_", "tr_"))]
    this.environment |= {"TZ": "Asia/Kathmandu", "LC_ALL": others[0] if others else "C"}
    yield


def disk(this: Round) -> contextlib.AbstractContextManager[None]:
    """Keeps the disk busy."""
    return programs([sys.executable, "-c", WRITE, str(this.folder / "busy")])


@contextlib.contextmanager
def memory(this: Round) -> Iterator[None]:
    """Mounts a small private /dev/shm."""
    mount = 'mount -t tmpfs -o size=512M tmpfs /dev/shm && exec "$0" "$@"'
    this.prefix[:0] = ["unshare", "-m", "sh", "-c", mount]
    yield


@contextlib.contextmanager
def stops(this: Round) -> Iterator[None]:
    """Stops random test processes for up to three seconds each."""
    end = threading.Event()

    def stop_some() -> None:
        draw = random.Random(this.random.random())
        while not end.wait(draw.uniform(0.5, 3.0)):
            found = [each for runner in this.runners for each in test_processes(runner.pid)]
            if not found:
                continue
            chosen = draw.choice(found)
            with contextlib.suppress(ProcessLookupError):
                os.kill(chosen, signal.SIGSTOP)
                end.wait(draw.uniform(0.2, 3.0))
                os.kill(chosen, signal.SIGCONT)

    thread = threading.Thread(target=stop_some)
    thread.start()
    try:
        yield
    finally:
        end.set()
        thread.join()


def test_processes(parent: int) -> list[int]:
    """Lists the test processes below `parent`, without the processes started by tests."""
    found = []
    children = Path(f"/proc/{parent}/task/{parent}/children")
    with contextlib.suppress(OSError):
        for child in map(int, children.read_text().split()):
            command = Path(f"/proc/{child}/cmdline").read_bytes()
            if b"o80_test_" in command or b"execnet" in command:
                found.append(child)
            else:
                found += test_processes(child)
    return found


CONDITIONS: dict[str, Condition] = {
    each.__name__: each for each in (processor, busy, quota, order, user, zone, disk, memory, stops)
}


def available() -> list[str]:
    """Lists the conditions that are possible on this machine."""
    root = os.geteuid() == 0
    trial = processor_groups() / "o80-soak-try"
    with contextlib.suppress(OSError):
        trial.mkdir(exist_ok=True)
    has_quota = any((trial / name).exists() for name in ("cpu.max", "cpu.cfs_quota_us"))
    with contextlib.suppress(OSError):
        trial.rmdir()
    as_user = [*NOBODY, sys.executable, "-c", STARTS]
    has_user = root and subprocess.run(as_user, capture_output=True).returncode == 0
    lacking = {"quota": not has_quota, "memory": not root, "user": not has_user}
    for name in [name for name, lacks in lacking.items() if lacks]:
        print(f"condition {name}: not possible here")
    return [name for name in CONDITIONS if not lacking.get(name, False)]


def python_files() -> list[str]:
    """Lists the files that pytest reads by itself, in a fixed order."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["pytest"]
    folders = settings["ini_options"]["testpaths"]
    return sorted(str(file) for each in folders for file in (ROOT / each).rglob("test_*.py"))


def commands_of(this: Round, chosen: argparse.Namespace) -> dict[str, list[str]]:
    """Builds the commands of the runners, by name."""
    cpp = ctest(str(this.folder / "cpp"), "dev", *shlex.split(chosen.ctest or "-LE '^check$'"))
    one_of = max(1, round(1.0 / chosen.share))
    if one_of > 1:
        cpp += ["-I", f"{this.random.randint(1, one_of)},,{one_of}"]
    options = shlex.split(chosen.pytest or "-m 'not check'")
    python = pytest(str(this.folder / "python"), *options)
    if this.shuffled:
        cpp += ["--schedule-random"]
    if not chosen.pytest and (this.shuffled or one_of > 1):
        files = python_files()
        files = this.random.sample(files, max(1, len(files) // one_of))
        python += files if this.shuffled else sorted(files)
    runners = {"cpp": cpp, "python": python}
    if bool(chosen.ctest) != bool(chosen.pytest):  # runs only the chosen tests
        del runners["python" if chosen.ctest else "cpp"]
    return {name: [*this.prefix, *command] for name, command in runners.items()}


def play(this: Round, names: list[str], chosen: argparse.Namespace) -> list[str]:
    """Runs the tests under these conditions; returns the failures."""
    with contextlib.ExitStack() as stack:
        for name in names:
            stack.enter_context(CONDITIONS[name](this))
        commands = commands_of(this, chosen)
        for name, command in commands.items():
            with (this.folder / f"{name}.log").open("wb") as log:
                environment = {**os.environ, **this.environment}
                this.runners.append(
                    subprocess.Popen(command, cwd=ROOT, env=environment, stdout=log, stderr=log)
                )
        try:
            returned = [runner.wait() for runner in this.runners]
        finally:
            for runner in this.runners:
                runner.terminate()
    failed = []
    for name, status in zip(commands, returned, strict=True):
        found, report = Outcomes(), this.folder / f"{name}.xml"
        if report.exists():
            found.read_report(report)
        failed += found.failed
        if status != 0 and not found.failed:
            failed.append(f"the runner itself, with status {status}: {this.folder / name}.log")
    return failed


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=20)
    parser.add_argument("--seed", type=int, default=int(time.time()))
    parser.add_argument("--first", type=int, default=0, help="number of the first round")
    parser.add_argument("--conditions", nargs="+", choices=CONDITIONS, help="all of these at once")
    parser.add_argument("--ctest", default="", help="options of ctest that choose tests in C++")
    parser.add_argument("--pytest", default="", help="files and options of pytest")
    parser.add_argument("--share", type=float, default=1.0, help="part of the tests in each round")
    chosen = parser.parse_args()
    if not 0.0 < chosen.share <= 1.0:
        parser.error(f"--share must lie above 0 and be at most 1, got {chosen.share:g}")
    use_tools()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # also ends the programs beside the tests
    # ctest lists the tests in a file that an ordinary user may not write
    if not run(Step("build", [*build("dev"), ["ctest", "--preset", "dev", "-N"]])):
        return 1
    can = available()
    found: dict[str, list[str]] = {}
    for number in range(chosen.first, chosen.first + chosen.rounds):
        draw = random.Random(f"{chosen.seed} {number}")
        names = chosen.conditions or draw.sample(can, draw.randint(1, min(3, len(can))))
        folder = FOLDER / f"{chosen.seed}-{number}"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        begin, before = time.monotonic(), set(os.listdir("/dev/shm"))
        what = f"round {number} of seed {chosen.seed} ({', '.join(names)})"
        failed = play(Round(draw, folder), names, chosen)
        failed += [f"left in /dev/shm: {name}" for name in set(os.listdir("/dev/shm")) - before]
        print(f"{what}: {len(failed)} failed in {time.monotonic() - begin:.0f} s", flush=True)
        for test in failed:
            print(f"  {test}", flush=True)
            found.setdefault(test, []).append(what)
    print(f"{chosen.rounds} rounds, {len(found)} tests failed at least once")
    for test, rounds in sorted(found.items()):
        print(f"{test}\n  in {'; '.join(rounds)}")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
