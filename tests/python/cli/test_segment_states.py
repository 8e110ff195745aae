"""How every text names the state of a segment: damaged, stopped, hanging, of another user."""

import contextlib
import json
import os
import pwd
import signal
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from processes import WAIT, Running

NOBODY = 65534
BECOME = """
import contextlib, ctypes, io, json, os, sys
import o80, o80.cli, o80.view.source_list

def say(words, **environment):
    "Runs a command; its exit code, output and errors."
    before, argv = dict(os.environ), sys.argv
    os.environ.update(environment)
    sys.argv = ["o80", *words]
    out, error, code = io.StringIO(), io.StringIO(), 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        try:
            o80.cli.main()
        except SystemExit as end:
            code = end.code or 0
    os.environ.clear()
    os.environ.update(before)
    sys.argv = argv
    return code, out.getvalue(), error.getvalue()

def viewed():
    "What a page lists."
    sources = o80.view.source_list.SourceList([])
    return [*(source.state() for source in sources.now()), sources.waiting]

if user := int(sys.argv.pop(1)):
    # this user may not be able to import anything: import all that is needed
    for name in vars(o80)["__all__"]:
        getattr(o80, name)
    for words in ("list", "list --json", "info x", "stop x", "stop --all", "clean x", "halt x"):
        say(words.split(), O80_DIRECTORY="/nowhere")
    os.setgroups([])
    os.setgid(user)
    os.setuid(user)
    ctypes.CDLL(None).prctl(4, 1)  # PR_SET_DUMPABLE: otherwise root owns its /proc/self
"""
COMMANDS = """
for line in sys.stdin:
    words, environment = json.loads(line)
    print(json.dumps(say(words, **environment) if words else viewed()), flush=True)
"""
SERVE = """
with o80.Backend("arm", 1, bursting=True, permission=int(sys.argv[1], 8)) as backend:
    backend.publish([0.0])
    print("ready", flush=True)
    sys.stdin.readline()
if "stay" in sys.argv:
    print("ended", flush=True)
    sys.stdin.read()
"""


class Machine:
    """Runs commands, in one process, and backends, each in its own, as one user."""

    def __init__(self, folder: Path, user: int = 0) -> None:
        self.folder = folder
        self.user = str(user)
        self.environment = {
            **os.environ, "O80_DIRECTORY": str(folder), "COLUMNS": "200", "NO_COLOR": "1",
        }  # fmt: skip
        self.process = self.started(COMMANDS)

    def started(self, program: str, *words: str) -> Running:
        words = (BECOME + program, self.user, *words)
        return Running(sys.executable, "-c", *words, env=self.environment)

    def close(self) -> None:
        self.process.communicate(timeout=WAIT)

    def ask(self, words: Sequence[str], **environment: str) -> Any:
        self.process.stdin.write(json.dumps([words, environment]) + "\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())

    def o80(self, *words: str, fails: bool = False, **environment: str) -> str:
        """Output of a command; its errors if it should fail."""
        code, out, error = self.ask(words, **environment)
        assert (code != 0) == fails, out + error
        return " ".join((error if fails else out).replace("│", " ").split())

    def state(self) -> str:
        """The state of the only segment, as `o80 list` prints and gives it."""
        (row,) = json.loads(self.o80("list", "--json"))
        assert f" {row['state']} " in self.o80("list")
        return str(row["state"])

    def expect(self, state: str) -> None:
        """Every text about a readable segment names this state."""
        assert self.state() == state
        assert f"arm, {state}, rows" in self.o80("info", "arm")
        known = "running" if state == "hangs" else state  # rows are not read for a list of names
        assert f"arm ({known})" in self.o80("info", "leg", fails=True)

    def backend(self, permission: str = "600", *words: str) -> Running:
        """A process with a backend."""
        process = self.started(SERVE, permission, *words)
        assert process.stdout.readline() == "ready\n"
        return process


@pytest.fixture(scope="module")
def directory() -> Iterator[Path]:
    """A directory of segments that every user can enter and write, as /dev/shm."""
    path = Path(f"/dev/shm/state-test-{os.getpid()}")
    path.mkdir()
    path.chmod(0o1777)
    try:
        yield path
    finally:
        path.rmdir()


@pytest.fixture
def folder(directory: Path) -> Iterator[Path]:
    """It is empty before and after a test."""
    yield directory
    for file in directory.iterdir():
        file.unlink()


@pytest.fixture(scope="module")
def here(directory: Path) -> Iterator[Machine]:
    with contextlib.closing(Machine(directory)) as machine:
        yield machine


@pytest.fixture(scope="module")
def nobody(directory: Path) -> Iterator[Machine]:
    if os.geteuid() != 0:
        pytest.skip("only root may become another user")
    with contextlib.closing(Machine(directory, NOBODY)) as machine:
        yield machine


def test_a_process_that_is_stopped_hangs_until_it_is_continued(folder: Path, here: Machine) -> None:
    with here.backend() as process:
        here.expect("running")
        process.send_signal(signal.SIGSTOP)
        os.waitid(os.P_PID, process.pid, os.WSTOPPED)
        here.expect("hangs")
        for said in (here.o80("list"), here.o80("info", "arm")):
            assert f"(pid {process.pid}) is stopped, continue it with `kill -CONT" in said
        assert "1 running: not removed" in here.o80("clean")
        assert "is not removed: it still has a backend" in here.o80("clean", "arm", fails=True)
        said = here.o80("stop", "arm", "--timeout", "0", fails=True)
        assert "did not stop in 0 s" in said
        assert f"`kill -CONT {process.pid}`" in said
        assert "kill -9" not in said
        process.send_signal(signal.SIGCONT)
        process.wait(timeout=WAIT)


def test_a_backend_that_has_ended_in_order_leaves_nothing(folder: Path, here: Machine) -> None:
    with here.backend("600", "stay") as process:
        process.stdin.close()
        assert process.stdout.readline() == "ended\n"
        assert here.o80("list", "--json") == "[]"
        assert "Nothing runs" in here.o80("list")
        assert "no backend 'arm' runs; nothing runs" in here.o80("stop", "arm", fails=True)
        assert "Nothing to remove." in here.o80("clean")
        assert "there is no segment 'arm'" in here.o80("clean", "arm", fails=True)
        assert "no segment has that name" in here.o80("info", "arm", fails=True)


def test_a_failed_backend_is_failed_everywhere(folder: Path, here: Machine) -> None:
    failing = SERVE.replace("    sys.stdin.readline()", "    raise OSError(5)")
    process = here.started(failing, "600")
    process.communicate(timeout=WAIT)
    assert process.returncode == 1
    here.expect("failed")
    assert "OSError: 5" in here.o80("echo", "arm", fails=True)
    assert "no backend 'arm' runs; nothing runs" in here.o80("stop", "arm", fails=True)
    assert "removed arm" in here.o80("clean")


def damaged(folder: Path, offset: int, size: int) -> None:
    with (folder / "o80-arm").open("r+b") as file:
        file.seek(offset)
        file.write(b"\xff" * size)


def expect_unknown(here: Machine) -> None:
    """Nothing is said of the only segment that was not seen."""
    assert here.state() == "unknown"
    problem = json.loads(here.o80("list", "--json"))[0]["problem"]
    assert problem
    assert problem in here.o80("list")
    assert f"cannot be attached ({here.folder}/o80-arm): {problem}" in here.o80(
        "info", "arm", fails=True
    )
    assert "arm (unknown)" in here.o80("info", "leg", fails=True)
    said = here.o80("stop", "arm", fails=True)
    assert "it is unknown whether 'arm'" in said
    assert problem in said
    assert "nothing that this user can see runs" in here.o80("stop", "leg", fails=True)
    assert "Nothing that this user can see runs." in here.o80("stop", "--all")


@pytest.mark.parametrize(("offset", "size"), [(8, 4), (64, 64)], ids=["version", "sizes"])
def test_of_a_damaged_segment_nothing_is_said_that_was_not_seen(
    folder: Path, here: Machine, offset: int, size: int
) -> None:
    with here.backend() as process:
        damaged(folder, offset, size)
        expect_unknown(here)
        assert "1 unknown: not removed" in here.o80("clean")
        assert process.poll() is None


@pytest.mark.parametrize("size", [100, 0])
def test_so_it_is_of_one_that_was_cut(folder: Path, here: Machine, size: int) -> None:
    with here.backend():
        pass
    os.truncate(folder / "o80-arm", size)
    expect_unknown(here)


@pytest.mark.parametrize("permission", ["600", "644", "666"])
def test_a_user_sees_of_a_segment_of_root_what_its_permission_says(
    folder: Path, here: Machine, nobody: Machine, permission: str
) -> None:
    with here.backend(permission):
        here.expect("running")
        if permission == "600":
            assert nobody.state() == "unknown"
            assert "arm: it cannot be opened: Permission denied" in nobody.o80("list")
            assert "--permission 640 (its group)" in nobody.o80("info", "arm", fails=True)
            assert "arm (unknown)" in nobody.o80("info", "leg", fails=True)
            said = nobody.o80("stop", "arm", fails=True)
            assert "it is unknown whether 'arm' of user root runs" in said
            assert "Nothing that this user can see runs." in nobody.o80("stop", "--all")
            assert "1 unknown: not removed" in nobody.o80("clean")
        else:
            nobody.expect("running")
            said = nobody.o80("stop", "arm", fails=True)
            assert "belongs to user root: only that user and root can stop it" in said
            assert "1 running: not removed" in nobody.o80("clean")
            assert "is not removed: it still has a backend" in nobody.o80(
                "clean", "arm", fails=True
            )
        if permission == "644":
            said = nobody.o80("halt", "arm", fails=True)
            assert "cannot be commanded by this user" in said
    here.expect("killed")
    if permission == "600":
        assert nobody.state() == "unknown"
    else:
        nobody.expect("killed")
    said = nobody.o80("clean", "arm", fails=True)
    assert "cannot be removed by this user" in said
    assert "belongs to user root" in said
    assert "removed arm" in here.o80("clean", "arm")


def test_root_believes_a_segment_of_a_user_only_if_it_is_told_to(
    folder: Path, here: Machine, nobody: Machine
) -> None:
    user = pwd.getpwuid(NOBODY).pw_name
    with nobody.backend() as process:
        nobody.expect("running")
        assert here.state() == "unknown"
        untrusted = f"belongs to user {user}, whom this user does not trust"
        assert untrusted in here.o80("list")
        assert untrusted in here.o80("info", "arm", fails=True)
        assert "arm (unknown)" in here.o80("info", "leg", fails=True)
        said = here.o80("stop", "arm", fails=True)
        assert f"it is unknown whether 'arm' of user {user} runs" in said
        assert "1 unknown: not removed" in here.o80("clean")
        assert "arm, running, rows" in here.o80("info", "arm", O80_TRUST=user)
        assert "arm has stopped" in here.o80("stop", "arm", O80_TRUST=user)
        process.wait(timeout=WAIT)


def test_the_view_says_what_it_has_not_seen(folder: Path, here: Machine, nobody: Machine) -> None:
    with here.backend():
        (shown, _) = nobody.ask([])
        assert (shown["name"], shown["state"]) == ("arm", "unknown")
        assert "cannot be opened" in shown["problem"]
        (shown, _) = here.ask([])
        assert shown["state"] == "running"
    (shown, _) = here.ask([])
    assert shown["state"] == "killed"


def test_of_a_directory_that_cannot_be_read_nobody_says_that_nothing_runs(
    folder: Path, here: Machine, nobody: Machine
) -> None:
    with here.backend():
        folder.chmod(0o700)
        try:
            for words in (["list"], ["stop", "arm"], ["stop", "--all"], ["clean"]):
                assert f"{folder} cannot be read" in nobody.o80(*words, fails=True), words
            (waiting,) = nobody.ask([])
            assert f"{folder} cannot be read" in waiting
        finally:
            folder.chmod(0o1777)
