"""The demo runs from end to end, tells the truth, and leaves nothing behind."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

import o80

RECORDINGS = Path(__file__).resolve().parents[4] / "shared" / "data" / "ball_gun_2019"
EPISODES = 4
MODES = ("real time", "processes", "inline")
STARTING = 60.0  # [s]
PLAIN = {**os.environ, "PATH": os.defpath}  # of a terminal in which nothing was activated


def demo(output: Path, *arguments: str) -> list[str]:
    return [sys.executable, "-m", "o80_table_tennis.demo", f"--output={output}", *arguments]


def live_segments(process: int) -> set[str]:
    """Names of the running segments that a demo has started."""
    return {
        segment.name
        for segment in o80.segments()
        if segment.life == "running" and f"-{process}-" in segment.name
    }


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Folder and text of a short demo, on recordings where there are any."""
    output = tmp_path_factory.mktemp("demo")
    balls = [f"--balls={RECORDINGS}"] if RECORDINGS.is_dir() else []
    arguments = [f"--episodes={EPISODES}", "--real-time-episodes=1", *balls]
    process = subprocess.Popen(
        demo(output, *arguments),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=PLAIN,
        text=True,
    )
    try:
        text, errors = process.communicate(timeout=290)
    finally:
        process.kill()
    assert process.returncode == 0, errors
    assert not errors
    assert not live_segments(process.pid)
    return output, text


@pytest.fixture(scope="module")
def report(played: tuple[Path, str]) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((played[0] / "report.json").read_text())
    return content


def test_processes_and_inline_played_the_same(report: dict[str, Any]) -> None:
    told = ("returned", "touched", "reward", "steps")
    processes, inline = report["modes"]["processes"], report["modes"]["inline"]
    assert [processes[key] for key in told] == [inline[key] for key in told]


def test_baselines_stand_beside_the_policy(report: dict[str, Any]) -> None:
    policies = report["policies"]
    assert list(policies) == ["scripted", "learned", "still arm", "random, fine", "random, coarse"]
    for numbers in policies.values():
        assert numbers["balls"] == EPISODES
        low, high = numbers["returned_95_percent"]
        assert low <= numbers["returned"] <= min(high, numbers["touched"]) <= 1
    assert policies["scripted"]["reward"] == report["modes"]["inline"]["reward"]
    assert policies["scripted"]["returned"] > policies["still arm"]["returned"]


def test_it_tells_how_the_arm_kept_its_time(report: dict[str, Any]) -> None:
    numbers = report["modes"]["real time"]
    assert 0 < numbers["arm_rate"] < 501
    lateness = [numbers[f"arm_lateness_us_p{p}"] for p in ("50", "90", "99", "99.9", "100")]
    assert lateness == sorted(lateness)
    for key in ("arm_overruns", "arm_skipped", "late_actions", "largest_lateness_rows"):
        assert numbers[key] >= 0


def test_every_episode_is_in_the_recording(report: dict[str, Any]) -> None:
    counts = [report["modes"][mode]["recorded_episodes"] for mode in MODES]
    assert (
        counts == [report["modes"][mode]["episodes"] for mode in MODES] == [1, EPISODES, EPISODES]
    )


def test_what_it_says_to_type_works_in_the_terminal_in_which_it_ran(
    played: tuple[Path, str],
) -> None:
    folder, text = played
    recording = str(folder / "run.mcap")
    printed = [line.split("#")[0] for line in text.splitlines() if line.startswith("  ")]
    commands = {line.split()[1]: line for line in printed if recording in line}
    assert sorted(commands) == ["plot", "replay", "view"]
    assert shutil.which(commands["view"].split()[0], path=PLAIN["PATH"])

    for line in (f"{commands['plot']} -o {folder / 'p.png'}", commands["replay"]):
        done = subprocess.run(
            ["sh", "-c", line], env=PLAIN, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_it_leaves_nothing_behind(tmp_path: Path, sent: signal.Signals) -> None:
    process = subprocess.Popen(
        demo(tmp_path, "--real-time-episodes=50"),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        end = time.monotonic() + STARTING
        while len(live_segments(process.pid)) < 2:
            assert process.poll() is None
            assert time.monotonic() < end
            time.sleep(0.05)
        # as a terminal does: to all of its processes
        os.killpg(process.pid, sent)
        assert process.wait(STARTING) != 0
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()
    assert not live_segments(process.pid)


@pytest.mark.parametrize(
    ("output", "options", "said"),
    [
        ("new", ["--balls=/nowhere"], "no such file"),
        ("taken", [], "--output"),
        ("new", ["--muscle", "steel", "--real-time-episodes", "0"], "linear, hill"),
    ],
)
def test_what_the_demo_cannot_do_is_said_in_a_line(
    output: str, options: list[str], said: str, tmp_path: Path
) -> None:
    (tmp_path / "taken").touch()
    done = subprocess.run(
        demo(tmp_path / output, *options), capture_output=True, text=True, timeout=STARTING
    )

    assert done.returncode != 0
    assert said in done.stderr
    assert "Traceback" not in done.stderr
