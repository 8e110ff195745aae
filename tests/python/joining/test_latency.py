"""The delay between two segments that see the same motion."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from processes import o80_says

import o80
from o80.rows.columns import columns_of

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


def with_rows(like: o80.History, times: np.ndarray, values: np.ndarray) -> o80.History:
    """Rows with a value each, captured at any times [s]."""
    rows = np.repeat(like.rows[:1], len(times))
    kept = {"extended.capture_time": 10**9 + np.rint(times * 1e9), "extended.value": values}
    for column in columns_of(like.schema):
        if column.name in kept:
            place = np.ndarray((len(rows),), column.dtype, rows, column.offset, rows.strides)
            place[:] = kept[column.name]
    return o80.History(like._decoder, rows)


@pytest.mark.parametrize(
    ("noise", "jitter", "gaps", "period"),
    [(0.1, 0.0, 0, 0.0054), (0.2, 0.0, 0, 0.002), (0.1, 0.003, 0, 0.01), (0.1, 0.0, 3, 0.0054)],
)
def test_the_true_delay_lies_within_the_uncertainty_as_often_as_it_says(
    noise: float, jitter: float, gaps: int, period: float, segment: str
) -> None:
    """40 drawn motions each; stamps jitter, and both signals are lost for 0.4 s at times."""
    like = signal(segment, np.zeros(2))
    errors, uncertainties = [], []
    for seed in range(100, 140):
        rng = np.random.default_rng(seed)
        delay = rng.uniform(-0.1, 0.1)
        f = motion(rng)
        sources = []
        for step, late in ((0.002, 0.0), (period, delay)):
            at = np.arange(0.0, 6.0, step)
            values = f(at - late) + rng.normal(0, noise, len(at))
            stamps = np.sort(at + rng.uniform(-jitter, jitter, len(at)))
            kept = np.full(len(at), True)
            for begin in rng.uniform(0.0, 5.6, gaps):
                kept &= (at < begin) | (at > begin + 0.4)
            sources.append(with_rows(like, stamps[kept], values[kept]))
        one, other = ((source, "extended.value") for source in sources)
        found = o80.latency(one, other, most=0.2)
        errors.append(found.seconds - delay)
        uncertainties.append(found.uncertainty)
    shares = np.abs(errors) / uncertainties
    assert np.mean(shares < 2) >= 0.9
    assert 0.5 <= np.mean(shares < 1) <= 0.85
    assert np.sqrt(np.mean(np.square(uncertainties))) < 0.01 * max(noise, 0.2)


def test_stated_errors_of_capture_times_are_in_the_uncertainty(segment: str) -> None:
    f, t = motion(np.random.default_rng(4)), np.arange(2000) * PERIOD * 1e-9
    one = signal(segment, f(t)), "extended.value"
    extended = {"capture_time": np.int64, "capture_error": np.int64, "value": np.float64}
    with o80.Backend(segment, 0, extended=extended, history=2000, lanes=1) as backend:
        for number, value in enumerate(f(t - 0.01)):
            if number:
                backend.step()
            row = {"capture_time": 1 + number * PERIOD, "capture_error": 3_000_000, "value": value}
            backend.publish(None, row)
        with o80.Frontend(segment) as reader:
            found = o80.latency(one, (reader.history(), "extended.value"), most=0.2)
    assert found.uncertainty == pytest.approx(0.003, rel=0.01)
    assert found.seconds == pytest.approx(0.01, abs=1e-5)


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
    said = o80_says("latency", desired, observed, *where)
    assert said.startswith(f"{observed} behind {desired}: ")
    assert 30 < float(said.split(": ")[1].split()[0]) < 60  # 1 / gain = 50 ms
    assert " ms" in o80_says(
        "latency", f"{segment}:norm(desired)", f"{segment}:norm(observed)", *where
    )
    assert "write SEGMENT:FIELD" in o80_says("latency", "arm", observed, *where, code=1)
