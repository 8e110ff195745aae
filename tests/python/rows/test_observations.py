"""One observation, many of them, and waiting for the next."""

import io
import itertools
import pickle
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mixed_robots import Mode, recorded

import o80


def test_states_of_one_number_are_a_float_array(arm: o80.Frontend) -> None:
    arm.add_command("elbow", 0.5)
    observation = arm.burst(1)

    assert observation.desired.dtype == np.float64
    assert observation.desired.tolist() == [0.0, 0.5]
    assert observation.observed.shape == (2,)
    assert observation.extended.effort.shape == (2,)
    assert observation.extended["effort"][1] == 0.5
    assert observation.active.tolist() == [False, True]
    assert observation.clamped.tolist() == [False, False]


def test_groups_of_different_types_have_names_also_when_they_are_printed(segment: str) -> None:
    groups = {"joints": ({"position": float}, ["a", "b"]), "gripper": float, "mode": Mode}
    with o80.Backend(segment, groups) as backend:
        backend.publish({"gripper": 0.25, "mode": Mode.MOVE})
        frontend = o80.Frontend(segment)
        observed = frontend.latest().observed

        assert observed.joints["position"].tolist() == [0.0, 0.0]
        assert observed.gripper == observed["gripper"] == 0.25
        assert observed.mode == Mode.MOVE == frontend.enums["mode"]("MOVE")
        assert list(observed) == ["joints", "gripper", "mode"]
        with pytest.raises(AttributeError, match="joints, gripper, mode"):
            _ = observed.wrist
        for row in (observed, pickle.loads(pickle.dumps(observed))):
            assert "mode=MOVE" in repr(row)
        assert "mode=['MOVE']" in repr(frontend.history(1).observed)
        frontend.close()


def test_many_actuators_fill_several_words_of_a_mask(segment: str) -> None:
    with o80.Backend(segment, 130) as backend:
        backend.publish(np.zeros(130))
        with o80.Frontend(segment) as frontend:
            for actuator in (0, 63, 64, 129):
                frontend.add_command(actuator, 1.0)
            frontend.pulse()
            backend.publish(backend.step())

            assert np.flatnonzero(frontend.latest().active).tolist() == [0, 63, 64, 129]
            assert np.flatnonzero(backend.active).tolist() == [0, 63, 64, 129]
            assert np.flatnonzero(frontend.history(1).active[0]).tolist() == [0, 63, 64, 129]


def test_a_pure_sensor_has_no_actuators(segment: str) -> None:
    with o80.Backend(segment, extended={"force": (float, 3)}) as backend:
        backend.publish(extended={"force": [1.0, 2.0, 3.0]})
        with o80.Frontend(segment) as frontend:
            observation = frontend.latest()

            assert frontend.actuators == []
            assert observation.extended.force.tolist() == [1.0, 2.0, 3.0]
            assert observation.active.tolist() == []
            assert len(observation.observed) == 0
            assert observation.flat().tolist() == [1.0, 2.0, 3.0]
            history = frontend.history()
            assert history.extended.force.shape == (1, 3)
            assert history.active.shape == (1, 0)
            assert len(history.observed) == 0
            assert "force" in repr(observation)


# ---------------------------------------------------------------------------- history


def test_a_history_is_a_sequence_of_observations(arm: o80.Frontend) -> None:
    arm.add_command(0, 1.0, iterations=10)
    arm.burst(10)
    history = arm.history()

    assert history[-1].desired[0] == 1.0
    assert history[3].iteration == 3
    assert [observation.iteration for observation in history] == list(range(11))
    assert history[2:4].iteration.tolist() == [2, 3]
    assert isinstance(history[0], o80.Observation)
    with pytest.raises(IndexError):
        history[11]
    assert "0 to 10" in repr(history)
    assert "no observation" in repr(arm.history(0))


def test_fields_are_columns_of_the_whole_history(arm: o80.Frontend) -> None:
    arm.add_command("elbow", 1.0, iterations=10)
    arm.burst(10)
    history = arm.history(8)

    iteration, elbow = arm.history(8, fields=["iteration", "desired.elbow"])
    assert iteration.tolist() == [*range(3, 11)]
    assert elbow.tolist() == history.desired[:, 1].tolist()
    both = arm.history(8, fields="observed")
    assert both.tolist() == history.observed.tolist()
    assert both.flags.c_contiguous
    both[:] = 7.0
    assert not (arm.history(8, fields="observed") == 7.0).any()


def test_fields_are_selected_as_rows_are(segment: str) -> None:
    with o80.Backend(segment, ["a"], history=10) as backend:
        for k in range(35):
            backend.publish([float(k)])
        with o80.Frontend(segment) as frontend:

            def rows(*given: int, **selection: int) -> list[float]:
                return [*frontend.history(*given, fields="observed", **selection)]

            assert rows() == [*range(25, 35)]
            assert rows(3) == [32, 33, 34]
            assert rows(since=0, until=26) == [25, 26]
            assert rows(from_time=frontend.wait_for(33).time) == [33, 34]
            assert rows(0) == rows(since=40) == rows(until=20) == []
            assert frontend.history(0, fields="time").dtype == np.int64
            assert frontend.history(fields=[]) == ()


def test_a_wrong_field_is_refused_with_the_nearest_name(arm: o80.Frontend) -> None:
    with pytest.raises(o80.InvalidArgument, match=r"'observed\.elbov'.*'observed\.elbow'"):
        arm.history(fields="observed.elbov")
    with pytest.raises(o80.InvalidArgument, match="desired"):
        arm.history(fields=["observed", "elbow"])
    for wrong in (3, [3], {"observed": 1}, "", "observed.", b"observed"):
        with pytest.raises(o80.InvalidArgument, match=r"fields must|a path|has no number"):
            arm.history(fields=wrong)  # type: ignore[arg-type]


def test_fields_of_rows_that_are_overwritten_meanwhile_are_whole(segment: str) -> None:
    with o80.Backend(segment, 8, history=500) as backend, ThreadPoolExecutor(1) as pool:
        backend.publish(np.zeros(8))
        with o80.Frontend(segment) as frontend:
            names = [f"observed.{frontend.actuators[i].name}" for i in (0, 7)]

            def read() -> None:
                while frontend.published < 20_000:
                    iteration, *numbers = frontend.history(fields=["iteration", *names])
                    assert all(np.array_equal(each, iteration) for each in numbers)
                    assert (np.diff(iteration) == 1).all()

            reading = pool.submit(read)
            for k in range(1, 20_001):
                backend.publish(np.full(8, float(k)))
            reading.result()


def test_rows_share_no_memory(arm: o80.Frontend) -> None:
    arm.burst(3)
    for read in (arm.history, arm.latest):
        one, other = read(), read()
        one.observed[:] = 7.0
        assert not other.observed.any()
        assert not read().observed.any()


# ---------------------------------------------------------------------------- waiting


def test_a_stream_may_begin_in_the_past(arm: o80.Frontend) -> None:
    arm.burst(10)
    stream = arm.stream(since=3, timeout=0.0)

    assert [next(stream).iteration for _ in range(8)] == list(range(3, 11))
    with pytest.raises(o80.TimeoutError):
        next(stream)


# ------------------------------------------------------------------------------------------- saving


def test_a_frame_names_parts_actuators_and_fields() -> None:
    groups = {"joints": ({"position": float, "mode": Mode}, ["left", "right"]), "grip": float}
    frame = recorded(groups, {"force": (float, 2)}, 0).to_frame()

    assert frame.index.name == "iteration"
    assert {"time", "halted", "active.left", "braking.grip"} < set(frame.columns)
    assert set(frame["observed.right.mode"].cat.categories) == {"IDLE", "MOVE", "HOLD"}


def test_an_empty_history_is_saved_too(arm: o80.Frontend) -> None:
    empty = arm.history(0)
    assert len(empty.to_frame()) == 0
    assert "observed.elbow" in empty.to_frame()
    file = io.BytesIO()
    np.save(file, empty.rows)
    assert len(pickle.loads(pickle.dumps(empty))) == 0


def test_a_history_itself_is_saved(arm: o80.Frontend, tmp_path: Path) -> None:
    arm.add_command("elbow", 0.3, iterations=20)
    arm.burst(20)
    history = arm.history()
    np.save(tmp_path / "run.npy", history)
    np.savez(tmp_path / "run.npz", run=history, rest=history[10:])
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file["rows"] = history
    with h5py.File(tmp_path / "run.h5") as file:
        stored = file["rows"][:]
    loaded = np.load(tmp_path / "run.npz")
    for rows in (np.load(tmp_path / "run.npy"), loaded["run"], stored):
        assert np.array_equal(rows["desired"], history.desired)
        assert np.array_equal(rows["iteration"], history.iteration)
    assert len(loaded["rest"]) == 11


def test_without_pandas_the_error_names_the_extra(
    arm: o80.Frontend, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(o80.MissingExtra, match=r'pip install "o80\[pandas\]"') as missing:
        arm.history().to_frame()
    assert isinstance(missing.value, ImportError)


# ---------------------------------------------------------------------------- by time and iteration


_names = (f"test-times-{i}" for i in itertools.count())
MILLISECOND = 1_000_000


@pytest.fixture(scope="module")
def old() -> Iterator[o80.Frontend]:
    """A robot of which rows 69 to 100 are left, at 1000 Hz of simulated time."""
    with o80.robots.load("two_joints").inline(next(_names), history=32) as frontend:
        frontend.burst(100)
        yield frontend


TIMES = st.integers(-5 * MILLISECOND, 105 * MILLISECOND)


@given(TIMES)
def test_the_row_at_a_time_is_the_newest_at_or_before_it(old: o80.Frontend, time: int) -> None:
    history = old.history()
    earlier = history.iteration[history.time <= time]
    for source in (old, history):
        if len(earlier):
            assert source.at_time(time).iteration == earlier[-1]
        else:
            with pytest.raises(o80.RowOverwritten, match="ns or before"):
                source.at_time(time)


@given(
    st.one_of(st.none(), TIMES),
    st.one_of(st.none(), TIMES),
    st.integers(60, 110),
    st.integers(60, 110),
)
def test_rows_between_times_are_those_that_numpy_finds(
    old: o80.Frontend, first: int | None, last: int | None, since: int, until: int
) -> None:
    history = old.history()
    wanted = (history.iteration >= since) & (history.iteration <= until)
    wanted &= history.time >= (first if first is not None else -(10**18))
    wanted &= history.time <= (last if last is not None else 10**18)
    arguments: dict[str, Any] = {
        "since": since,
        "until": until,
        "from_time": first,
        "to_time": last,
    }
    for rows in (old.history(**arguments), history.select(**arguments)):
        assert rows.iteration.tolist() == history.iteration[wanted].tolist()


@given(st.floats(0, 0.2))
def test_the_last_seconds_count_from_the_newest_row(old: o80.Frontend, seconds: float) -> None:
    history = old.history()
    wanted = history.time > history.time[-1] - round(seconds * 1e9)
    for rows in (old.history(seconds=seconds), history.select(seconds=seconds)):
        assert rows.iteration.tolist() == history.iteration[wanted].tolist()
    for everything in ({"seconds": 1e300}, {"from_time": -(10**30), "to_time": 10**30}):
        assert len(old.history(**everything)) == len(history)
    n = round(seconds * 200)
    assert old.history(n).iteration.tolist() == history.select(n).iteration.tolist()


@given(st.integers(0, 40), st.integers(1, 7), TIMES)
def test_a_part_of_a_history_is_a_history(old: o80.Frontend, n: int, step: int, time: int) -> None:
    part = old.history()[::step]
    iterations = part.iteration.tolist()
    assert part.select(n).iteration.tolist() == iterations[max(0, len(iterations) - n) :]
    assert [part.at_iteration(k).iteration for k in iterations] == iterations
    expected = part.iteration[part.time >= time].tolist()
    assert part.select(from_time=time).iteration.tolist() == expected


def test_a_row_of_a_history_is_found_by_its_iteration(old: o80.Frontend) -> None:
    history = old.history(10)
    assert history.at_iteration(95).iteration == 95
    assert history[-1].iteration == 100
    with pytest.raises(o80.RowOverwritten, match=r"row 5 is not in .* holds rows 91"):
        history.at_iteration(5)
    with pytest.raises(o80.RowOverwritten, match="which is empty"):
        history[:0].at_iteration(95)
    with pytest.raises(o80.RowOverwritten, match="which is empty"):
        history[:0].at_time(0)
    with pytest.raises(o80.InvalidArgument, match="step of a slice must be positive, got -1"):
        history[::-1]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"n": 3, "seconds": 1.0}, "give either n, or seconds"),
        ({"n": 3, "since": 1}, "give either n, or seconds"),
        ({"seconds": 1.0, "to_time": 1}, "give either n, or seconds"),
        ({"seconds": -1.0}, "seconds must be a finite number of at least 0, got -1.0"),
        ({"seconds": float("inf")}, "seconds must be"),
        ({"seconds": "2"}, "seconds must be"),
        ({"from_time": 0.5}, "from_time must be a whole number, got 0.5"),
        ({"n": -1}, "must be at least 0, got -1"),
    ],
)
def test_a_selection_that_cannot_be_is_refused(
    old: o80.Frontend, arguments: dict[str, object], text: str
) -> None:
    for ask in (old.history, old.history().select):
        with pytest.raises(o80.InvalidArgument, match=text):
            ask(**arguments)  # type: ignore[arg-type]


def test_a_selection_of_nothing_is_empty(old: o80.Frontend) -> None:
    nothing = old.history(since=10**9)
    assert len(nothing) == 0
    assert len(nothing.select(seconds=1.0)) == 0
    assert np.array_equal(nothing.select(3).time, [])
