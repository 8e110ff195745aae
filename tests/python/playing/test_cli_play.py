"""o80 play: what it says, how it ends, and what other commands see meanwhile."""

import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from processes import O80, WAIT, run_o80

import o80


def run(*words: str | Path, code: int = 0) -> str:
    done = run_o80(*words, code=code)
    return done.stdout + done.stderr


@contextmanager
def playing(*words: str | Path) -> Iterator[subprocess.Popen[str]]:
    """o80 play, which Ctrl-C ends in order."""
    command = [O80, "play", *map(str, words)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as player:
        try:
            yield player
            player.send_signal(signal.SIGINT)
            _, said = player.communicate(timeout=WAIT)
            assert player.returncode == 0, said
        finally:
            player.kill()


def test_other_commands_see_the_rows(recorded: Path, segment: str, tmp_path: Path) -> None:
    copy = tmp_path / "copy.mcap"
    with playing(recorded, "--fast"):
        with o80.Frontend(segment, WAIT) as arm:
            arm.wait_for(200, timeout=WAIT)
        assert "played" in run("list")
        assert " 200 " in run("echo", segment, "--count", "1")
        said = run("info", segment)
        assert "a recording of 1000 Hz is played" in said
        assert "robot two_joints, played, rows" in said
        assert "is a recording that is being played" in run("halt", segment, code=1)
        run("save", segment, "-o", copy)
        run("plot", segment, "-o", tmp_path / "run.png")
    run("diff", recorded, copy)
    assert segment not in run("list")


def test_it_ends_with_the_last_row(recorded: Path) -> None:
    said = run("play", recorded, "--speed", "2")
    assert "playing 0.1 s" in said or "playing 0.2 s" in said
    assert "201 rows" in said


def test_bursts_are_served(recorded: Path, segment: str) -> None:
    with playing(recorded, "--bursts"), o80.Frontend(segment, WAIT) as arm:
        assert arm.burst(20).iteration == 20


def test_a_name_that_is_taken_is_refused(recorded: Path, segment: str) -> None:
    with o80.robots.load("two_joints").inline(segment):
        assert "--prefix" in run("play", recorded, code=1)
        run("play", recorded, "--speed", "100", "--name", f"{segment}-b")


def test_contradictory_options_are_refused_by_their_names(recorded: Path) -> None:
    assert "--fast" in (said := run("play", recorded, "--fast", "--speed", "2", code=2))
    assert "--speed 2" in said
    said = " ".join(run("play", recorded, "--from", "5", "--to", "2", code=2).split())
    assert "--to" in said
    assert "--from (5 s)" in said
    assert "--from" in run("play", recorded, "--from", "-1", code=2)


def test_a_name_that_is_no_file_is_told_how_to_become_one(tmp_path: Path) -> None:
    said = run("play", "arm", code=1)
    assert "there is no file arm" in said
    assert "o80 record arm -o arm.mcap" in said
    said = run("export", "arm", "--format", "lerobot", "-o", tmp_path / "set", code=1)
    assert "o80 record arm -o arm.mcap" in said
