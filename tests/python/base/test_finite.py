"""Numbers that are not finite, in formats that have none."""

import ast
import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from processes import PRODUCT

from o80.base.finite import json_text

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: (
        st.lists(inner) | st.tuples(inner) | st.dictionaries(st.text() | st.floats(), inner)
    ),
)


def refuse(word: str) -> Any:
    raise AssertionError(f"{word} is no JSON")


def count(value: Any) -> int:
    if isinstance(value, dict):
        return sum(map(count, value.values()))
    if isinstance(value, list | tuple):
        return sum(map(count, value))
    return int(isinstance(value, float) and not math.isfinite(value))


@given(VALUES)
def test_what_is_written_is_strict_json_and_says_what_it_lacks(value: Any) -> None:
    said: list[str] = []
    read = json.loads(json_text(value, say=said.append), parse_constant=refuse)
    wrong = count(value)
    assert bool(said) == bool(wrong)
    if wrong:
        assert said[0].startswith(f"{wrong} number")
    if isinstance(value, float):
        assert read == (value if math.isfinite(value) else None)


def test_a_field_is_named_with_its_count() -> None:
    rows = [{"arm": {"elbow": np.float64("nan"), "wrist": 1.0}}] * 2
    with pytest.warns(
        RuntimeWarning, match=r"2 numbers are not finite, written as null: arm\.elbow \(2\)"
    ):
        assert json.loads(json_text(rows)) == [{"arm": {"elbow": None, "wrist": 1.0}}] * 2


def test_all_json_of_the_product_is_written_there() -> None:
    found = [
        f"{file}:{node.lineno}"
        for file in PRODUCT
        if file.name != "finite.py"
        for node in ast.walk(ast.parse(file.read_text()))
        if (
            (isinstance(node, ast.Attribute) and node.attr in ("dump", "dumps"))
            and isinstance(node.value, ast.Name)
            and node.value.id == "json"
        )
        or (
            isinstance(node, ast.ImportFrom)
            and node.module == "json"
            and {"dump", "dumps", "JSONEncoder"} & {each.name for each in node.names}
        )
    ]
    assert not found
