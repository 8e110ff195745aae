"""Makes Gymnasium's info of several copies: for each entry an array over all copies, and a mask.

The result equals that of Gymnasium's `VectorEnv._add_info` for infos of single environments.
"""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.learning.task import EVERY, Index

Info = dict[str, Any]


def add(infos: Info, values: Mapping[str, Any], copies: Index, count: int) -> None:
    """Adds values (n, ...) of n of `count` copies, and keeps the values of other copies."""
    if not values:
        return
    if not infos and isinstance(copies, slice):
        # the usual case: it happens in every step
        _add_all(infos, values, count)
        return
    mask = np.zeros(count, np.bool_)
    mask[copies] = True
    for name, value in values.items():
        there = infos.get(name)
        if type(value) is not np.ndarray and isinstance(value, Mapping):
            there = {} if there is None else there
            add(there, value, copies, count)
        else:
            array = _array(value)
            if there is None:
                there = _empty(array, count)
            there[copies] = array
        infos[name] = there
        known = infos.get("_" + name)
        infos["_" + name] = mask.copy() if known is None else known | mask


def _add_all(infos: Info, values: Mapping[str, Any], count: int) -> None:
    """Adds values of all copies to an empty info."""
    masks = iter(_masks(len(values), count).copy())
    for name, value in values.items():
        plain = type(value) is np.ndarray and value.dtype.char != "U" and value.ndim
        if plain and len(value) == count:
            infos[name] = value.copy()
        elif isinstance(value, Mapping):
            infos[name] = nested = Info()
            add(nested, value, EVERY, count)
        else:
            array = _array(value)
            infos[name] = there = _empty(array, count)
            there[...] = array
        infos["_" + name] = next(masks)


@lru_cache
def _masks(names: int, count: int) -> NDArray[np.bool_]:
    return np.ones((names, count), np.bool_)


def add_split(
    among: Info, others: Info, values: Mapping[str, Any], chosen: NDArray[np.bool_]
) -> None:
    """Splits values (copies, ...) of all copies between two empty infos: those of the chosen
    copies go to `among`, those of the others to `others`.
    """
    count, left = len(chosen), ~chosen
    numbers = chosen.nonzero()[0]
    for name, value in values.items():
        if type(value) is not np.ndarray or value.dtype.kind == "U" or value.shape[:1] != (count,):
            add(among, some({name: value}, chosen), numbers, count)
            if numbers.size < count:
                add(others, some({name: value}, left), left.nonzero()[0], count)
            continue
        there = _empty(value, count)
        there[numbers] = value[numbers]
        among[name], among[f"_{name}"] = there, chosen.copy()
        if numbers.size < count:
            remaining = value.copy()
            remaining[numbers] = None if value.dtype == object else 0
            others[name], others[f"_{name}"] = remaining, left.copy()


def some(values: Mapping[str, Any], rows: NDArray[Any]) -> Info:
    """Selects values of some copies, by an index or a mask of the n that have values."""
    return {name: _some(value, rows) for name, value in values.items()}


def _some(value: Any, rows: NDArray[Any]) -> Any:
    if type(value) is np.ndarray:
        return _array(value)[rows] if value.ndim else value
    if isinstance(value, Mapping):
        return some(value, rows)
    return _array(value)[rows] if np.ndim(value) else value


def of_one(values: Mapping[str, Any]) -> Info:
    """Makes the info of a single copy."""
    return {
        name: _first(value)
        if type(value) is np.ndarray
        else of_one(value)
        if isinstance(value, Mapping)
        else _first(np.asarray(value))
        for name, value in values.items()
    }


def _array(value: Any) -> NDArray[Any]:
    array: NDArray[Any] = value if type(value) is np.ndarray else np.asarray(value)
    return array.astype(object) if array.dtype.kind == "U" else array


def _empty(like: NDArray[Any], count: int) -> NDArray[Any]:
    shape = count, *like.shape[1:]
    return np.zeros(shape, like.dtype) if like.dtype != object else np.empty(shape, object)  # None


def _first(array: NDArray[Any]) -> Any:
    # as Python's numbers and texts: Gymnasium makes arrays of objects for np.bool_
    if array.ndim == 1 and array.dtype.char in "dl?U":
        return array.item(0)
    value = array[0] if array.ndim else array[()]
    if isinstance(value, np.ndarray):
        return _array(value).copy()
    return value.item() if isinstance(value, np.bool_ | np.str_) else value
