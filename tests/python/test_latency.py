"""The delay between two segments that see the same motion."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from processes import run_o80

import o80

PAGE = Path(__file__).resolve().parents[2] / "docs" / "time.md"

PERIOD = 2_000_000  # [ns]


def signal(name: str, values: np.ndarray, *, first: int = 0, period: int = PERIOD) -> o80.History:
    """Rows with a value each, captured at a fixed rate."""
    extended = {"capture_time": np.int64, "value": np.float64, "pair": (np.float64, 2)}
    with o80.Backend(name, 0, extended=extended, history=len(values), lanes=1) as backend:
        for number, value in enumerate(values):
            if number:
                backend.step()
            time = 1 + first + number * period
            backend.publish(None, {"capture_time": time, "value": value, "pair": [value, 0]})
        with o80.Frontend(name) as reader:
            return reader.history()


def motion(rng: np.random.Generator) -> Callable[[Any], Any]:
    """Several sines together."""
    rates, phases = rng.uniform(0.3, 3.0, 8), rng.uniform(0, 6, 8)
    return lambda t: np.sin(2 * np.pi * np.multiply.outer(t, rates) + phases).sum(axis=-1)


@pytest.mark.parametrize("seed", range(6))
def test_a_known_delay_is_found_within_its_uncertainty(seed: int, segment: str) -> None:
    rng = np.random.default_rng(seed)
    delay = rng.uniform(-0.1, 0.1)
    f = motion(rng)
    t = np.arange(3000) * PERIOD * 1e-9
    slower = np.arange(1100) * 5_400_000
    seen = f(slower * 1e-9 - delay) + rng.normal(0, 0.1, len(slower))
    found = o80.latency(
        (signal(segment, f(t)), "extended.value"),
        (signal(segment, seen, period=5_400_000), "extended.value"),
        most=0.2,
    )
    assert found.uncertainty < 0.002
    assert abs(found.seconds - delay) < 5 * found.uncertainty + 1e-4
    assert found.correlation > 0.9


def test_a_function_of_fields_may_be_compared(segment: str) -> None:
    rng = np.random.default_rng(1)
    f = motion(rng)
    t = np.arange(2000) * PERIOD * 1e-9
    one, other = signal(segment, f(t)), signal(segment, -3.0 * f(t - 0.05) + 7.0)
    found = o80.latency(
        (one, "extended.value"), (other, lambda rows: -rows.extended.pair[:, 0]), most=0.2
    )
    assert found.seconds == pytest.approx(0.05, abs=1e-3)
    assert str(found).startswith("5")


def test_signals_without_a_common_motion_are_told(segment: str) -> None:
    rng = np.random.default_rng(2)
    one, other = (signal(segment, rng.normal(size=2000)) for _ in range(2))
    with pytest.raises(o80.Error, match="no common motion"):
        o80.latency((one, "extended.value"), (other, "extended.value"), most=0.2)
    still = signal(segment, np.zeros(2000))
    with pytest.raises(o80.Error, match="no common motion"):
        o80.latency((one, "extended.value"), (still, "extended.value"), most=0.2)


def test_wrong_arguments_are_named(segment: str) -> None:
    one = signal(segment, np.sin(np.arange(300) * 0.05))
    value = (one, "extended.value")
    wrong: list[tuple[Any, float, str]] = [
        ((one, "extended.valeu"), 0.1, "Did you mean 'extended.value'"),
        ((one, "extended.pair"), 0.1, "names 2 numbers"),
        (value, 0.5, "too little"),
        (value, float("nan"), "most must be"),
        ((one[:20], "extended.value"), 0.1, "at least 50 are needed"),
        ((one, lambda rows: 0.0), 0.1, "one for each"),
    ]
    for signal_of_one, most, text in wrong:
        with pytest.raises(o80.InvalidArgument, match=text):
            o80.latency(signal_of_one, value, most=most)


def command(*words: str | Path, code: int = 0) -> str:
    done = run_o80("latency", *words, code=code)
    return done.stdout + done.stderr


def test_the_command_tells_the_delay_in_a_recording(segment: str, tmp_path: Path) -> None:
    with (
        o80.robots.load("two_joints").inline(segment, gain=20.0) as arm,
        o80.Recording(tmp_path / "run.mcap", [segment]),
    ):
        targets = np.random.default_rng(3).uniform(-1, 1, (20, 2))
        arm.add_trajectory(targets, iterations=100)
        arm.pulse()
        for _ in range(20):
            arm.burst(100)
    where: list[str | Path] = ["--recording", tmp_path / "run.mcap", "--most", "0.3"]
    desired, observed = f"{segment}:desired.elbow", f"{segment}:observed.elbow"
    said = command(desired, observed, *where)
    assert said.startswith(f"{observed} behind {desired}: ")
    assert 30 < float(said.split(": ")[1].split()[0]) < 60  # 1 / gain = 50 ms
    assert " ms" in command(f"{segment}:norm(desired)", f"{segment}:norm(observed)", *where)
    assert "write SEGMENT:FIELD" in command("arm", observed, *where, code=1)


def test_the_programs_of_the_page_run(capsys: pytest.CaptureFixture[str]) -> None:
    programs = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(), re.MULTILINE | re.DOTALL)
    assert len(programs) == 2
    for program in programs:
        exec(compile(program, str(PAGE), "exec"), {})
    shape, other, age, capture = capsys.readouterr().out.splitlines()
    assert (shape, other) == ("(501,)", "(501, 2)")
    assert 0 < float(age) < 1 / 180
    time, error, epoch = capture.split()
    assert int(time) > 0
    assert int(error) > 0
    assert int(epoch) >= 0
