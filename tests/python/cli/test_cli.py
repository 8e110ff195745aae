"""The command line, as a person and as a script would use it."""

import contextlib
import json
import os
import pty
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from processes import O80, Running, run_o80


def o80(folder: Path, *words: str, fails: bool = False) -> str:
    """Output of a command; its errors if it should fail."""
    environment = {"O80_DIRECTORY": str(folder), "COLUMNS": "100", "NO_COLOR": "1"}
    done = run_o80(*words, code=None, env=os.environ | environment)
    assert (done.returncode != 0) == fails, done.stdout + done.stderr
    return done.stderr if fails else done.stdout


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[Running]:
    """A robot that is up."""
    environment = {**os.environ, "O80_DIRECTORY": str(tmp_path)}
    with Running(O80, "run", "two_joints", "--frequency", 200, env=environment) as process:
        assert "runs on segment" in process.stdout.readline()
        yield process


def test_help_teaches_and_lists_robots(tmp_path: Path) -> None:
    assert "o80 run two_joints" in o80(tmp_path, "--help")
    assert "two_joints" in o80(tmp_path, "run", "--help")
    assert "--gain number" in o80(tmp_path, "run", "two_joints", "--help")


def test_the_version_and_the_prefix_are_printed(tmp_path: Path) -> None:
    version = o80(tmp_path, "--version")
    assert version.count(".") == 2
    assert version == subprocess.check_output([sys.executable, "-m", "o80", "--version"], text=True)
    assert (Path(o80(tmp_path, "--prefix").strip()) / "bin" / "o80-run").exists()


def test_a_running_robot_is_listed(tmp_path: Path, robot: Running) -> None:
    table = o80(tmp_path, "list")
    assert "two_joints" in table
    assert "running" in table
    assert "200 Hz" in table
    (row,) = json.loads(o80(tmp_path, "list", "--json"))
    assert row["segment"] == "two_joints"
    assert row["pid"] == robot.pid
    assert row["frequency"] == 200.0
    assert row["hangs"] is False
    assert row["halted"] == ""


def test_a_watched_list_fits_a_terminal_of_80_columns_and_leaves_it_as_it_was(
    tmp_path: Path, robot: Running
) -> None:
    terminal = {"O80_DIRECTORY": str(tmp_path), "COLUMNS": "80", "NO_COLOR": "1", "TERM": "xterm"}
    ours, theirs = pty.openpty()
    watching = subprocess.Popen(
        [O80, "list", "--watch"], stdout=theirs, stderr=theirs, env=os.environ | terminal
    )
    os.close(theirs)
    seen = ""
    while seen.count("last row") < 2:
        seen += os.read(ours, 4096).decode()
    watching.send_signal(signal.SIGINT)
    with contextlib.suppress(OSError):  # the end of a terminal is an error
        while part := os.read(ours, 4096):
            seen += part.decode()
    assert watching.wait(timeout=60) == 130
    os.close(ours)
    assert seen.startswith("\033[?1049h")
    assert seen.rstrip().endswith("\033[?1049l\033[?25h")
    lines = re.sub(r"\033\[[?0-9]*[a-zA-Z]", "", seen).splitlines()
    table = [line for line in lines if not line.startswith("two_joints:")]
    assert "two_joints" in "".join(table)
    assert max(map(len, table)) <= 80


def test_info_describes_a_robot(tmp_path: Path, robot: Running) -> None:
    text = o80(tmp_path, "info", "two_joints")
    assert "shoulder" in text
    assert "-3 to 3" in text
    assert "effort(2) [rad]" in text
    assert "reset(seed=0)" in text
    schema = json.loads(o80(tmp_path, "info", "two_joints", "--json"))
    assert [actuator["name"] for actuator in schema["actuators"]] == ["shoulder", "elbow"]


def test_echo_prints_rows_in_order(tmp_path: Path, robot: Running) -> None:
    lines = o80(tmp_path, "echo", "two_joints", "--every", "--count", "5", "--json").splitlines()
    rows = [json.loads(line) for line in lines]
    first = rows[0]["iteration"]
    assert [row["iteration"] for row in rows] == list(range(first, first + 5))
    assert rows[0]["extended"] == {"homing": False, "effort": [0.0, 0.0]}
    line = o80(tmp_path, "echo", "two_joints", "--count", "1")
    assert "observed (0 0)" in line
    assert "extended homing False effort (0 0)" in line
    assert line.rstrip().endswith("idle")


def test_a_mark_stands_in_the_journal(tmp_path: Path, robot: Running) -> None:
    said = o80(tmp_path, "mark", "two_joints", "changed the battery")
    iteration = int(said.split("iteration ")[1].split(":")[0])
    o80(tmp_path, "halt", "two_joints")
    assert "halted too" in o80(tmp_path, "mark", "two_joints", "halted too")
    lines = o80(tmp_path, "echo", "two_joints", "--commands", "--count", "5").splitlines()
    assert lines[0].startswith(f"{iteration:>8} pid ")
    assert lines[0].endswith('mark "changed the battery"')
    assert "a mark has 1 to 976 bytes" in o80(tmp_path, "mark", "two_joints", "", fails=True)


def test_stop_names_what_runs(tmp_path: Path, robot: Running) -> None:
    assert "running: two_joints" in o80(tmp_path, "stop", "arm", fails=True)
    assert "Did you mean 'two_joints'?" in o80(tmp_path, "stop", "twojoints", fails=True)
    assert "--all" in o80(tmp_path, "stop", fails=True)


def test_errors_name_the_cure(tmp_path: Path) -> None:
    for words, text in (
        ("run no_such_robot", "there are:"),
        ("run two_joint", "Did you mean 'two_joints'?"),
        ("run two_joints --frequenzy=5", "Did you mean --frequency?"),
        ("lst", "Did you mean 'list'?"),
        ("run two_joints --no-such-flag", "--help"),
        ("run two_joints --frequency fast", "from 0.001 to 1000000 [1/s], got 'fast'"),
        ("run two_joints --reach far", "option 'reach' must be a number, got 'far'"),
        ("echo nobody", "o80 run"),
        ("list --watch --json", "--json prints one list; leave out --watch"),
    ):
        boxed = o80(tmp_path, *words.split(), fails=True)
        assert text in " ".join(boxed.replace("│", " ").split())


def test_echo_prints_the_last_rows_of_a_dead_robot(tmp_path: Path, robot: Running) -> None:
    o80(tmp_path, "echo", "two_joints", "--count", "3", "--every")
    robot.kill()
    robot.wait()

    words = ("echo", "two_joints", "--count", "3", "--json")
    done = run_o80(*words, code=1, env=os.environ | {"O80_DIRECTORY": str(tmp_path)})

    first, *_, last = (json.loads(line)["iteration"] for line in done.stdout.splitlines())
    assert last == first + 2
    assert "was killed" in done.stderr


def test_errors_and_the_table_of_robots_name_the_page_about_the_symptom(tmp_path: Path) -> None:
    said = o80(tmp_path, "plot", "arm", "-o", "x.png", fails=True)
    assert said.endswith("See docs/symptoms/attach_times_out.md.\n")
