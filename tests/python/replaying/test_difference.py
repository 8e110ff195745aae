"""Two runs are compared row by row, bit for bit."""

from pathlib import Path

import numpy as np
import pytest
from mixed_robots import recorded
from processes import run_o80

import o80
from o80.difference import Difference, first_difference


def run_of(target: float, segment: str, iterations: int = 30) -> o80.History:
    with o80.robots.load("two_joints").inline(segment) as arm:
        arm.add_command("elbow", target, iterations=20)
        arm.burst(10)
        arm.burst(iterations - 10)
        return arm.history()


def changed(history: o80.History, row: int, byte: int) -> o80.History:
    """The same with one bit of a row flipped."""
    raw = bytearray(history.rows.tobytes())
    raw[row * history.rows.itemsize + byte] ^= 1
    return o80.History(history._decoder, np.frombuffer(bytes(raw), history.rows.dtype))


def test_a_field_of_the_clock_is_left_out(segment: str) -> None:
    """The description is the only thing that says so: see docs/drivers/simulators.md."""
    history = run_of(0.5, segment)
    other = changed(history, 3, history.schema["row"]["extended"])
    assert first_difference(history, other) is not None
    history.schema["extended"]["fields"][0]["origin"] = "clock"
    assert first_difference(history, other) is None


def test_not_a_number_equals_itself(segment: str) -> None:
    with o80.Backend(segment, {"sensor": float}, bursting=True) as backend:
        backend.publish({"sensor": 1.0})
        with o80.Frontend(segment) as frontend:
            frontend.burst(1, wait=False)
            backend.step()
            backend.publish({"sensor": float("nan")})
            history = frontend.history()

    assert first_difference(history, history) is None
    assert first_difference(history, history, tolerances={"observed": 0.1}) is None


def test_rows_that_one_lacks_are_a_difference(segment: str) -> None:
    history = run_of(0.5, segment)

    assert first_difference(history, history[:20]) == Difference(20, "", (True, False))
    assert first_difference(history[5:], history) == Difference(0, "", (False, True))


def test_columns_are_ignored_and_tolerated(segment: str) -> None:
    one, other = run_of(0.5, segment), run_of(0.5 + 1e-9, segment)

    assert first_difference(one, other) is not None
    parts = {"desired": 1e-8, "observed": 1e-8, "extended": 1e-8}
    assert first_difference(one, other, tolerances=parts) is None
    assert first_difference(one, other, ignore=list(parts)) is None
    found = first_difference(one, other, ignore=["desired", "observed"])
    assert found is not None
    assert str(found).startswith("iteration 1, extended.effort[1]: ")
    with pytest.raises(o80.InvalidArgument, match=r"no column 'desird'.*desired"):
        first_difference(one, other, ignore=["desird"])


def test_different_robots_are_refused(segment: str) -> None:
    with pytest.raises(o80.InvalidArgument, match="the robots differ"):
        first_difference(run_of(0.5, segment), recorded({"hand": "f8"}, None, 1))


def test_a_column_that_one_robot_lacks_may_be_ignored() -> None:
    one = recorded({"hand": "f8"}, {"force": "f8"}, 1)[:1]
    other = recorded({"hand": "f8"}, {"force": "f8", "warm": "?"}, 1)[:1]
    for pair in ((one, other), (other, one)):
        assert first_difference(*pair, ignore=["extended.warm"]) is None
        with pytest.raises(o80.InvalidArgument, match=r"extended\.warm is in one of them"):
            first_difference(*pair, ignore=["extended.force"])


def test_the_command_tells_by_its_exit_code(segment: str, tmp_path: Path) -> None:
    paths = []
    for i, target in enumerate((0.5, 0.5, 0.6)):
        paths.append(tmp_path / f"{i}.mcap")
        with o80.robots.load("two_joints").inline(segment) as arm, o80.Recording(paths[-1], arm):
            arm.add_command("elbow", target, iterations=20)
            arm.burst(25)
    for other, code, said in ((paths[1], 0, "identical"), (paths[2], 1, "desired.elbow")):
        assert said in run_o80("diff", paths[0], other, code=code).stdout
