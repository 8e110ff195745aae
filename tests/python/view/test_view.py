"""`o80.View`: the page of a program, served by a process of its own."""

import json
import signal
import urllib.request
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from processes import O80, WAIT, Running, end_of, run_python

import o80
from o80.view import page_file
from o80.view.page_file import write_page


def look(url: str) -> dict[str, Any]:
    parts = urlsplit(url)
    request = urllib.request.Request(
        f"http://{parts.netloc}/look",
        b"{}",
        {"Authorization": f"Bearer {parts.query.removeprefix('token=')}"},
    )
    with urllib.request.urlopen(request, timeout=WAIT) as answer:
        found: dict[str, Any] = json.load(answer)
        return found


def test_a_view_shows_frontends_names_and_recordings(arm: o80.Frontend, path: Path) -> None:
    with o80.Recording(path, arm):
        arm.burst(10)
    shown: list[Any] = [[arm, path], arm.segment, o80.open(path)]
    for what in shown:
        with o80.View(what) as view:
            assert look(view.url)["last"] == pytest.approx(0.01)
            assert f":{view.port}/" in view.url


def test_a_view_only_reads_what_it_shows(arm: o80.Frontend) -> None:
    """So it cannot slow the robot, whatever its pages ask."""
    with o80.View(arm) as view:
        for _ in range(5):
            look(view.url)
        maps = Path(f"/proc/{view._popen.pid}/maps").read_text().splitlines()
        own = [line.split() for line in maps if arm.segment in line]
        assert own
        assert {words[1] for words in own} == {"r--s"}
        assert not any("commanders" in words[-1] for words in own)


def test_a_view_ends_with_its_block_and_may_be_closed_twice(arm: o80.Frontend) -> None:
    with o80.View(arm) as view:
        assert view.alive
    assert not view.alive
    view.close()  # type: ignore[unreachable]
    with pytest.raises(OSError):  # noqa: PT011
        look(view.url)


@pytest.mark.parametrize("end", ["pass", "os.kill(os.getpid(), signal.SIGKILL)"])
def test_a_view_ends_with_its_program(end: str) -> None:
    program = (
        f"import o80, os, signal\nview = o80.View()\nprint(view._popen.pid, flush=True)\n{end}"
    )
    # the view inherits stderr: the end of that is its end
    end_of(int(run_python("-c", program, code=None).stdout))


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
    with Running(O80, "view", arm.segment) as running:
        assert look(running.stdout.readline().strip())["source"] == arm.segment
        running.send_signal(signal.SIGINT)
        assert running.wait(WAIT) == 0


def test_a_page_in_a_file_is_refused_with_a_cure(
    arm: o80.Frontend, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run, path = tmp_path / "run.mcap", tmp_path / "run.html"
    with o80.Recording(run, arm):
        arm.burst(1000)
    with pytest.raises(o80.InvalidArgument, match="o80 record arm"):
        write_page(["arm"], path)
    with monkeypatch.context() as changed:
        changed.setattr(page_file, "LARGEST", 1000)
        with pytest.raises(o80.InvalidArgument, match=r"about \d+ MB, .* `o80 cut"):
            write_page([str(run)], path)
    assert not path.exists()
    assert write_page([str(run)], path) == path.stat().st_size
    with pytest.raises(o80.InvalidArgument, match="exists"):
        write_page([str(run)], path)
    empty = tmp_path / "empty.mcap"
    with o80.Backend("none-yet", ["lift"]), o80.Recording(empty, "none-yet"):
        pass
    with pytest.raises(o80.RecordingError, match=r"empty\.mcap"):
        write_page([str(empty)], tmp_path / "empty.html")


def test_a_curve_in_a_file_has_the_extremes_and_gaps_of_all_rows() -> None:
    values = np.random.default_rng(1).standard_normal(500)
    values[100], values[200:230] = 50.0, np.nan
    recorded = page_file._Recorded.__new__(page_file._Recorded)
    recorded.ticks = np.arange(0, 500, 17)
    kept = recorded._kept(values)
    assert set(recorded.ticks) <= set(kept)
    assert np.nanmax(values[kept]) == 50.0
    for begin in recorded.ticks:
        of_all, drawn = (
            values[begin : begin + 17],
            values[kept[(kept >= begin) & (kept < begin + 17)]],
        )
        assert np.fmin.reduce(of_all) == pytest.approx(np.fmin.reduce(drawn), nan_ok=True)
        assert np.fmax.reduce(of_all) == pytest.approx(np.fmax.reduce(drawn), nan_ok=True)
        assert np.isnan(of_all).any() == np.isnan(drawn).any()
