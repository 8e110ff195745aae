"""Numbers in the rows of a history by a path, and the length of the vector that they are."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

import o80._core as _core
from o80.base.errors import InvalidArgument
from o80.rows.columns import Column, columns_of, values_of
from o80.rows.history import History


def columns_below(history: History, path: str) -> list[Column]:
    """The number that a path names, or all numbers below it. Raises InvalidArgument for none."""
    columns = {column.name: column for column in columns_of(history.schema)}
    chosen = [
        column
        for name, column in columns.items()
        if name == path or name.startswith((path + ".", path + "["))
    ]
    if not chosen:
        instead = _core.names_instead(path, list(columns))
        raise InvalidArgument(f"there is no field '{path}'{instead}")
    return chosen


def norm_of(path: str) -> Callable[[History], NDArray[np.float64]]:
    """Makes the Euclidean norm (T,) of all numbers below a path, such as "extended.velocity"."""

    def norm(history: History) -> NDArray[np.float64]:
        chosen = columns_below(history, path)
        numbers = [values_of(history, column).astype(np.float64) for column in chosen]
        length: NDArray[np.float64] = np.linalg.norm(numbers, axis=0)
        return length

    return norm
