"""Prints of programs: a full device, a closed pipe and a poor encoding end no work."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from processes import O80, Running

import o80
from o80.cli.app import COMMANDS

ASCII = {"LC_ALL": "C", "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}
WAIT = 120.0  # [s] only ends a hang
OUTPUTS = ("stdout", "stderr", "both", "ascii")


# runs `o80 COMMAND --help` in children of one program, which has loaded what they need; its
# arguments: a file for their exit codes, and the commands
HELP = """
import os, sys
import o80.cli.app, rich.markdown, typer.rich_utils
path, *commands = sys.argv[1:]
codes = []
for command in commands:
    if not (child := os.fork()):
        sys.argv = ["o80", command, "--help"]
        o80.cli.main()
    codes.append(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
open(path, "w").write(" ".join(map(str, codes)))
"""


def run(
    *words: str | Path, on: str = "", program: tuple[str | Path, ...] = (O80,)
) -> subprocess.CompletedProcess[str]:
    """on: what is full, or ascii: the encoding of both."""
    with Path("/dev/full").open("w") as full:
        return subprocess.run(
            [*program, *words],
            stdin=subprocess.DEVNULL,
            stdout=full if on in ("stdout", "both") else subprocess.PIPE,
            stderr=full if on in ("stderr", "both") else subprocess.PIPE,
            env=os.environ | (ASCII if on == "ascii" else {}),
            encoding="ascii" if on == "ascii" else "utf-8",
            timeout=WAIT,
            check=False,
        )


def check(done: subprocess.CompletedProcess[str], on: str, *codes: int) -> None:
    """codes: of all programs that printed, if it is not one."""
    said = (done.stdout or "") + (done.stderr or "")
    assert "Traceback" not in said
    assert "Exception ignored" not in said
    assert set(codes or [done.returncode]) == {1 if on in ("stdout", "both") else 0}, said
    if on == "stdout":
        words = "the standard output cannot be written: No space left"
        assert done.stderr.count(words) == max(1, len(codes))


@pytest.mark.parametrize("on", OUTPUTS)
def test_help_of_every_command_survives_its_output(on: str, tmp_path: Path) -> None:
    path = tmp_path / "codes"
    # each has its own letters; the output is that of one program, but for halt and run
    commands = [*COMMANDS] if on == "ascii" else ["halt", "run", "list"]
    done = run(path, *commands, on=on, program=(sys.executable, "-c", HELP))
    codes = [int(code) for code in path.read_text().split()]
    assert len(codes) == len(commands)
    check(done, on, *codes)


@pytest.fixture
def robot(segment: str) -> Iterator[None]:
    with o80.robots.load("two_joints").start(segment, frequency=200):
        yield


@pytest.mark.usefixtures("robot")
@pytest.mark.parametrize("on", ["both", "ascii"])
def test_what_lists_ends_with_words(segment: str, on: str) -> None:
    run("mark", segment, "begin")
    for words in (["list"], ["list", "--watch"], ["info", segment], ["echo", segment]):
        endless = words[-1] == "--watch" or words[0] == "echo"
        if not endless or on in ("stdout", "both"):  # what fails ends also what is endless
            check(run(*words, on=on), on)
    check(run("echo", segment, "--commands", "--count", "1", on=on), on)


@pytest.mark.usefixtures("robot")
@pytest.mark.parametrize("on", ["both", "ascii"])
def test_a_recorder_records_on(segment: str, path: Path, tmp_path: Path, on: str) -> None:
    done = run("record", segment, "-o", path, "--seconds", "1", on=on)
    assert done.returncode == 0  # it prints on stderr only
    assert o80.open(path)[segment].epochs[0].rows > 1
    play = run("play", path, "--prefix", "again-", "--speed", "4", on=on)
    assert play.returncode == 0
    npz: tuple[str | Path, ...] = ("export", path, "-o", tmp_path / "a.npz")
    for words in (npz, ("info", path)):
        check(run(*words, on=on), on)


@pytest.mark.usefixtures("robot")
def test_a_reader_that_has_enough_ends_it_quietly(segment: str) -> None:
    with Running(O80, "echo", segment, "--every") as echo:
        echo.stdout.readline()
        echo.stdout.close()
        said = echo.stderr.read()
        assert echo.wait(WAIT) == 0
    assert "Traceback" not in said
    assert "cannot be written" not in said
