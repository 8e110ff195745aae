"""`o80.View`: the page of a program, served by a process of its own."""

import json
import os
import re
import select
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

import o80

TIMEOUT = 60.0


def look(url: str) -> dict[str, Any]:
    parts = urlsplit(url)
    request = urllib.request.Request(
        f"http://{parts.netloc}/look",
        b"{}",
        {"Authorization": f"Bearer {parts.query.removeprefix('token=')}"},
    )
    with urllib.request.urlopen(request, timeout=TIMEOUT) as answer:
        found: dict[str, Any] = json.load(answer)
        return found


def child_of(view: o80.View) -> int:
    return view._popen.pid


def test_a_view_shows_frontends_names_and_recordings(arm: o80.Frontend, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with o80.Recording(path, arm):
        arm.burst(10)
    shown: list[Any] = [arm, arm.segment, [arm, path], path, str(path), o80.open(path)]
    for what in shown:
        with o80.View(what) as view:
            assert look(view.url)["last"] == pytest.approx(0.01)
            assert f":{view.port}/" in view.url


def test_a_view_only_reads_what_it_shows(arm: o80.Frontend) -> None:
    """So it cannot slow the robot, whatever its pages ask."""
    with o80.View(arm) as view:
        for _ in range(5):
            look(view.url)
        maps = Path(f"/proc/{child_of(view)}/maps").read_text().splitlines()
        own = [line.split() for line in maps if arm.segment in line]
        assert own
        assert {words[1] for words in own} == {"r--s"}
        assert not any("commanders" in words[-1] for words in own)


def test_a_view_ends_with_its_block_and_may_be_closed_twice(arm: o80.Frontend) -> None:
    with o80.View(arm) as view:
        assert view.alive
    assert not view.alive
    view.close()
    with pytest.raises(OSError):  # noqa: PT011
        look(view.url)


@pytest.mark.parametrize("end", ["pass", "os.kill(os.getpid(), signal.SIGKILL)", "os._exit(3)"])
def test_a_view_ends_with_its_program(end: str) -> None:
    program = (
        f"import o80, os, signal\nview = o80.View()\nprint(view._popen.pid, flush=True)\n{end}"
    )
    # the view inherits stderr: the end of that is its end
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=TIMEOUT
    )
    assert ends(int(done.stdout))


def ends(process: int) -> bool:
    """Waits for the end of a process, which may have been collected already."""
    try:
        descriptor = os.pidfd_open(process)
    except ProcessLookupError:
        return True
    try:
        end = select.poll()
        end.register(descriptor, select.POLLIN)
        return bool(end.poll(TIMEOUT * 1e3))
    finally:
        os.close(descriptor)


def test_a_taken_port_is_an_error_of_the_program(arm: o80.Frontend) -> None:
    with (
        o80.View(arm) as view,
        pytest.raises(o80.Error, match=f"port {view.port} .* is taken"),
    ):
        o80.View(arm, port=view.port)


def test_what_cannot_be_shown_is_refused(tmp_path: Path) -> None:
    with pytest.raises(o80.InvalidArgument, match="got 5"):
        o80.View([5])  # type: ignore[list-item]
    with pytest.raises(o80.Error, match=r"missing\.mcap"):
        o80.View(tmp_path / "missing.mcap")


def test_the_command_prints_the_address_that_is_bound(arm: o80.Frontend) -> None:
    command = [str(Path(sys.executable).with_name("o80")), "view", arm.segment]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as running:
        assert running.stdout is not None
        assert look(running.stdout.readline().strip())["source"] == arm.segment
        running.send_signal(signal.SIGINT)
        assert running.wait(TIMEOUT) == 0


def test_the_program_of_the_page_runs(tmp_path: Path) -> None:
    page = Path(__file__).resolve().parents[2] / "docs" / "view.md"
    [program] = re.findall(r"```python\n(.*?)```", page.read_text(), re.DOTALL)
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=TIMEOUT
    )
    assert done.returncode == 0, done.stderr
    assert "/?token=" in done.stdout
