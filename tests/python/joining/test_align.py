"""Rows of several sources are joined by the time of their capture; the delay between two."""

import pickle
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from processes import o80_says

import o80
from o80.joining.align import HowWord
from o80.joining.sources import shifts_of
from o80.rows.columns import columns_of

EXTENDED = {
    "capture_time": np.int64,
    "position": (np.float64, 3),
    "speed": np.float32,
    "count": np.int32,
    "seen": np.bool_,
}
Captures = list[int]
Search = Callable[[Captures, int], int | None]


def published(name: str, extended: dict[str, Any], rows: list[dict[str, Any]]) -> o80.History:
    """Rows of a device with these sensor values."""
    with o80.Backend(
        name, 0, extended=extended, history=len(rows), lanes=1, lane_blocks=64
    ) as backend:
        for number, row in enumerate(rows):
            if number:
                backend.step()
            backend.publish(None, row)
        with o80.Frontend(name) as reader:
            return reader.history()


def device(name: str, captures: Captures) -> o80.History:
    """Rows of a device that captured at these times [ns]; 0: it captured nothing."""
    rows = [
        {
            "capture_time": time,
            "position": [number, 2.0 * number, -1.0],
            "speed": 0.5 * number,
            "count": number,
            "seen": True,
        }
        for number, time in enumerate(captures)
    ]
    return published(name, EXTENDED, rows)


def nearest_row(captures: Captures, time: int) -> int | None:
    """The newest row of those captured nearest to a time; of two as near the older capture."""
    known = [capture for capture in captures if capture > 0]
    if not known:
        return None
    best = min(known, key=lambda capture: (abs(capture - time), capture))
    return max(i for i, capture in enumerate(captures) if capture == best)


def row_before(captures: Captures, time: int) -> int | None:
    known = [capture for capture in captures if 0 < capture <= time]
    return max(i for i, c in enumerate(captures) if c == max(known)) if known else None


TIMES = st.lists(st.integers(0, 50), min_size=1, max_size=12)


@given(captures=TIMES, at=st.lists(st.integers(-5, 60), max_size=12), most=st.integers(0, 20))
def test_each_time_gets_the_row_that_a_plain_search_finds(
    captures: Captures, at: list[int], most: int
) -> None:
    history = device("align-search", captures)
    ways: list[tuple[HowWord, Search]] = [("before", row_before), ("nearest", nearest_row)]
    for how, search in ways:
        joined = o80.align(
            {"device": history}, at=np.array(at, np.int64), how=how, max_age=most * 1e-9
        )
        got = joined["device"]
        for place, time in enumerate(at):
            row = search(captures, time)
            found = row is not None and abs(time - captures[row]) <= most
            assert bool(got.found[place]) == found
            if row is None:
                assert np.isnan(got.age[place])
            else:
                assert got.age[place] == pytest.approx((time - captures[row]) * 1e-9)
            if found:
                assert got.extended.count[place] == row
                assert got.iteration[place] == row
            else:
                assert np.isnan(got.extended.position[place]).all()
                assert np.isnan(got.extended.speed[place])
                assert not got.extended.seen[place]


@given(captures=TIMES, at=st.lists(st.integers(-5, 60), max_size=12))
def test_floats_lie_on_the_line_between_the_rows_around_a_time(
    captures: Captures, at: list[int]
) -> None:
    got = o80.align(
        {"device": device("align-line", captures)}, at=np.array(at, np.int64), how="linear"
    )["device"]
    rows = {capture: i for i, capture in enumerate(captures) if capture > 0}
    times = sorted(rows)
    for place, time in enumerate(at):
        inside = bool(times) and times[0] <= time <= times[-1]
        assert bool(got.found[place]) == inside
        if not inside:
            assert np.isnan(got.extended.speed[place])
            continue
        numbers = [float(rows[each]) for each in times]
        wanted = np.interp(time, times, numbers)
        assert got.extended.position[place].tolist() == pytest.approx([wanted, 2 * wanted, -1.0])
        assert got.extended.speed[place] == pytest.approx(0.5 * wanted)
        older = row_before(captures, time)
        assert got.extended.count[place] == older
        around = [abs(time - each) for each in (times[0], times[-1])]
        assert got.age[place] <= max(around) * 1e-9


def test_rows_of_one_source_give_the_times_and_programs_see_only_the_past(segment: str) -> None:
    slow, fast = device(segment, [10, 30, 50]), device(segment, [5, 15, 25, 35, 45])
    joined = o80.align({"slow": slow, "fast": fast}, by="slow")
    assert joined.time.tolist() == [10, 30, 50]
    assert joined["slow"].age.tolist() == [0, 0, 0]
    assert joined["fast"].extended.count.tolist() == [0, 2, 4]
    assert joined.complete.all()
    with pytest.raises(KeyError, match="there are: slow, fast"):
        joined["ball"]


def test_a_period_covers_the_time_in_which_all_have_rows(segment: str) -> None:
    one, other = device(segment, [10, 20, 43]), device(segment, [15, 60])
    joined = o80.align({"one": one, "other": other}, period=10e-9)
    assert joined.time.tolist() == [15, 25, 35]
    assert len(o80.align({"one": one, "none": device(segment, [0])}, period=1e-9).time) == 0


def test_a_recording_is_joined_like_the_running_robots(segment: str, path: Path) -> None:
    names = [segment, segment + "-other"]
    with (
        o80.robots.load("two_joints").inline(names[0], frequency=500) as one,
        o80.robots.load("two_joints").inline(names[1], frequency=100) as other,
        o80.Recording(path, names),
    ):
        for _ in range(10):
            o80.burst({one: 5, other: 1})
        live = o80.align([one, other], by=names[1])
    recorded = o80.align(o80.open(path), by=names[1])
    np.testing.assert_array_equal(live.time, recorded.time)
    np.testing.assert_array_equal(live[names[0]].rows, recorded[names[0]].rows)
    assert live[names[0]].iteration.tolist() == list(range(0, 51, 5))


def test_clocks_that_have_nothing_in_common_need_an_offset(segment: str) -> None:
    with o80.robots.load("two_joints").inline(segment) as arm:
        arm.burst(10)
        sources: dict[str, Any] = {"arm": arm, "device": device(segment + "-d", [10])}
        with pytest.raises(o80.InvalidArgument, match=r"different clocks.*offsets"):
            o80.align(sources, by="arm")
        joined = o80.align(sources, by="arm", offsets={"device": 5_000_000})
        assert joined["device"].found.tolist() == [False] * 6 + [True] * 5


def test_joined_rows_can_be_pickled_and_sliced(segment: str) -> None:
    joined = o80.align({"device": device(segment, [10, 20, 30])}, by="device")["device"]
    again = pickle.loads(pickle.dumps(joined))
    np.testing.assert_array_equal(again.rows, joined.rows)
    np.testing.assert_array_equal(again.age, joined.age)
    assert joined[1:].extended.count.tolist() == [1, 2]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({}, "give one of by"),
        ({"by": "b"}, "by: there is no 'b'; there are: a"),
        ({"period": 0.0}, "period must be at least"),
        ({"at": [0.5]}, "at must be .* of whole nanoseconds"),
        ({"by": "a", "how": "after"}, "how must be one of before, nearest, linear"),
        ({"by": "a", "how": {"b": "before"}}, "how: there is no 'b'"),
        ({"by": "a", "max_age": -1.0}, "max_age must be at least 0"),
        ({"by": "a", "offsets": {"b": 1}}, "offsets: there is no 'b'"),
    ],
)
def test_wrong_arguments_are_named(arguments: dict[str, Any], text: str, segment: str) -> None:
    with pytest.raises(o80.InvalidArgument, match=text):
        o80.align({"a": device(segment, [10])}, **arguments)


def test_what_is_no_source_is_named(segment: str) -> None:
    history = device(segment, [10])
    with pytest.raises(o80.InvalidArgument, match="give a mapping from names"):
        o80.align([history], by="a")  # type: ignore[list-item]
    with pytest.raises(o80.InvalidArgument, match="a must be a Frontend"):
        o80.align({"a": 5}, by="a")  # type: ignore[arg-type]
    with pytest.raises(o80.InvalidArgument, match="at least one source"):
        o80.align({}, period=0.1)


def test_runs_of_different_starts_of_a_computer_are_joined_on_the_wall_clock() -> None:
    clock = {"monotonic": SimpleNamespace(schema={"clock": "monotonic"})}
    runs = {"a": (clock["monotonic"], 10**18), "b": (clock["monotonic"], 10**18 + 10**9)}
    assert shifts_of(runs) == {"a": 10**18, "b": 10**18 + 10**9}  # type: ignore[arg-type]
    runs["b"] = (clock["monotonic"], 10**18 + 1000)  # one start: the wall clock was adjusted
    assert shifts_of(runs) == {"a": 0, "b": 0}  # type: ignore[arg-type]


class Mirrored:
    """A twin that mirrors rows of an arm, whose clocks have nothing in common."""

    def __init__(self, arm: o80.Frontend, twin: o80.Frontend) -> None:
        self.arm, self.twin = arm, twin
        self.partners: dict[int, int] = {}  # of each row of the twin

    def follow(self, iterations: int) -> None:
        seen = self.arm.latest()
        self.twin.add_command("elbow", 0.01 * seen.iteration)
        before = self.twin.published
        self.twin.burst(iterations, seen=seen)
        for row in range(before + 1, before + 1 + iterations):
            self.partners[row] = seen.iteration


@settings(max_examples=15)
@given(st.lists(st.tuples(st.integers(0, 7), st.integers(1, 4)), min_size=1, max_size=12))
def test_rows_of_a_twin_meet_the_rows_by_which_it_was_commanded(
    tmp_path_factory: pytest.TempPathFactory, steps: list[tuple[int, int]]
) -> None:
    path = tmp_path_factory.mktemp("seen") / "run.mcap"
    with (
        o80.Backend("test-seen-arm", ["joint"]) as robot,
        o80.robots.load("two_joints").inline("test-seen-twin") as twin,
    ):
        robot.publish()
        with o80.Frontend("test-seen-arm") as arm, o80.Recording(path, [arm, twin]):
            mirrored = Mirrored(arm, twin)
            twin.burst(3)
            for skipped, iterations in steps:
                for _ in range(skipped):
                    robot.step()
                    robot.publish()
                mirrored.follow(iterations)
            live = o80.align({"twin": twin, "arm": arm}, by="seen")
    recorded = o80.open(path)
    stored = o80.align({name: recorded[f"test-seen-{name}"] for name in ("twin", "arm")}, by="seen")
    for joined in (live, stored):
        rows = joined["twin"].iteration
        assert rows.tolist() == list(range(len(rows)))
        assert joined["arm"].found.tolist() == [row in mirrored.partners for row in rows]
        found = joined["arm"].found
        assert joined["arm"].iteration[found].tolist() == list(mirrored.partners.values())
        assert np.isnan(joined["arm"].age).all()
        assert joined["twin"].found.all()
        assert len(joined.time) == len(rows)


def test_rows_by_which_nothing_was_commanded_are_no_partners(arm: o80.Frontend) -> None:
    history = arm.history()
    sources: dict[str, Any] = {"arm": arm, "other": history}
    for wrong in ({"arm": arm}, dict(reversed(sources.items()))):
        with pytest.raises(o80.InvalidArgument, match="needs at least two sources"):
            o80.align(wrong, by="seen")
    with pytest.raises(o80.InvalidArgument, match=r"give the row when you send.*seen=row"):
        o80.align(sources, by="seen")
    with pytest.raises(o80.InvalidArgument, match="takes no period"):
        o80.align(sources, by="seen", how="nearest")
    arm.add_command("elbow", 0.1)
    arm.burst(2, seen=arm.latest())
    joined = o80.align(sources, by="seen")
    assert joined["other"].found.tolist() == [False, True, True]
    assert joined["other"].age[1:].tolist() == pytest.approx([0.001, 0.002])
    with pytest.raises(o80.InvalidArgument, match="give the row when you send"):
        o80.align(sources | {"other": arm.history(since=1)}, by="seen")


# ---------------------------------------------------------------------------------------- the delay


PERIOD = 2_000_000  # [ns]


def signal(name: str, values: np.ndarray) -> o80.History:
    """Rows with a value each, captured at a fixed rate."""
    extended = {"capture_time": np.int64, "value": np.float64, "pair": (np.float64, 2)}
    rows = [
        {"capture_time": 1 + number * PERIOD, "value": value, "pair": [value, 0]}
        for number, value in enumerate(values)
    ]
    return published(name, extended, rows)


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
    rows = [
        {"capture_time": 1 + number * PERIOD, "capture_error": 3_000_000, "value": value}
        for number, value in enumerate(f(t - 0.01))
    ]
    other = published(segment, extended, rows), "extended.value"
    found = o80.latency(one, other, most=0.2)
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


def test_wrong_arguments_of_a_delay_are_named(segment: str) -> None:
    one = signal(segment, np.sin(np.arange(300) * 0.05))
    value = (one, "extended.value")
    wrong: list[tuple[Any, float, str]] = [
        ((one, "extended.valeu"), 0.1, "Did you mean 'extended.value'"),
        ((one, "extended.pair"), 0.1, "choose one of several"),
        (value, 0.5, "too little"),
        (value, float("nan"), "most must be"),
        ((one[:20], "extended.value"), 0.1, "at least 50 are needed"),
        ((one, lambda rows: 0.0), 0.1, "a number for each row"),
    ]
    for signal_of_one, most, text in wrong:
        with pytest.raises(o80.InvalidArgument, match=text):
            o80.latency(signal_of_one, value, most=most)


def test_the_command_tells_the_delay_in_a_recording(segment: str, path: Path) -> None:
    with (
        o80.robots.load("two_joints").inline(segment, gain=20.0) as arm,
        o80.Recording(path, [segment]),
    ):
        targets = np.random.default_rng(3).uniform(-1, 1, (20, 2))
        arm.add_trajectory(targets, iterations=100)
        arm.pulse()
        for _ in range(20):
            arm.burst(100)
    where: list[str | Path] = ["--recording", path, "--most", "0.3"]
    desired, observed = f"{segment}:desired.elbow", f"{segment}:observed.elbow"
    said = o80_says("latency", desired, observed, *where)
    assert said.startswith(f"{observed} behind {desired}: ")
    assert 30 < float(said.split(": ")[1].split()[0]) < 60  # 1 / gain = 50 ms
    assert " ms" in o80_says(
        "latency", f"{segment}:norm(desired)", f"{segment}:norm(observed)", *where
    )
    assert "write SEGMENT:FIELD" in o80_says("latency", "arm", observed, *where, code=1)
