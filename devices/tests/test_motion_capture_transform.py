"""The transform from a motion capture system to the world."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import o80
from o80_devices.motion_capture.transform import Transform, product, quaternion_of

POINTS = {"a": (0.0, 0.0, 0.0), "b": (1.5, 0.0, 0.0), "c": (1.5, 2.7, 0.0), "d": (0.0, 2.7, 0.1)}

unit = st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4).filter(
    lambda numbers: np.linalg.norm(numbers) > 0.1
)


def matrix_of(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    x, y, z, w = quaternion
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    rotation: NDArray[np.float64] = np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross
    return rotation


@settings(deadline=None)
@given(numbers=unit, place=st.tuples(*[st.floats(-5, 5)] * 3), flat=st.booleans())
def test_a_known_transform_is_found(numbers, place, flat) -> None:  # type: ignore[no-untyped-def]
    rotation = matrix_of(np.array(numbers) / np.linalg.norm(numbers))
    points = {name: (x, y, 0.0 if flat else z) for name, (x, y, z) in POINTS.items()}
    moved = {name: rotation @ np.array(p) + np.array(place) for name, p in points.items()}
    found = Transform.estimated(points, moved)
    assert found.rotation == pytest.approx(rotation, abs=1e-9)
    assert found.translation == pytest.approx(np.array(place), abs=1e-9)
    assert max(found.residuals.values()) < 1e-9
    assert found.of_point(points["c"]) == pytest.approx(moved["c"], abs=1e-9)


@given(numbers=unit, others=unit)
def test_quaternions_are_those_of_the_matrices(numbers, others) -> None:  # type: ignore[no-untyped-def]
    one, two = (np.array(each) / np.linalg.norm(each) for each in (numbers, others))
    assert quaternion_of(matrix_of(one)) == pytest.approx(one * np.sign(one[3] or 1), abs=1e-7) or (
        abs(one[3]) < 1e-7
    )
    assert matrix_of(np.array(product(one, two))) == pytest.approx(
        matrix_of(one) @ matrix_of(two), abs=1e-9
    )


@pytest.mark.parametrize(
    ("measured", "text"),
    [
        (
            {"a": (0, 0, 0), "b": (1, 0, 0), "x": (1, 1, 1)},
            "at least three points",
        ),
        ({"a": (0, 0, 0), "b": (1, 0, 0), "c": (2, 0, 0)}, "lie on a line"),
        ({"a": (0, 0, 0), "b": (1, 0, 0), "c": (np.nan, 0, 0)}, "must be finite"),
    ],
)
def test_points_that_determine_nothing_are_refused(measured, text) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(o80.InvalidArgument, match=text):
        Transform.estimated(measured, POINTS)


def test_a_file_is_read_as_it_was_written(tmp_path: Path) -> None:
    file = tmp_path / "world.json"
    turned = {name: (-y, x, z + 0.5) for name, (x, y, z) in POINTS.items()}
    Transform.estimated(POINTS, turned).save(file)
    assert Transform.load(file).of_point((1.0, 2.0, 3.0)) == pytest.approx((-2.0, 1.0, 3.5))


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ("", "is not a transform file"),
        ('{"rotation": 1}', "is not a transform file"),
        ('{"rotation": [[1]], "translation": [0, 0, 0]}', "rotation must be 3 x 3"),
        (
            '{"rotation": [[2, 0, 0], [0, 1, 0], [0, 0, 1]], "translation": [0, 0, 0]}',
            "must be a rotation matrix",
        ),
    ],
)
def test_a_file_that_is_none_is_told(tmp_path: Path, content: str, text: str) -> None:
    file = tmp_path / "world.json"
    file.write_text(content)
    with pytest.raises(o80.InvalidArgument, match=text):
        Transform.load(file)
