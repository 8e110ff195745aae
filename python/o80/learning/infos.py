"""Gymnasium's info of several copies: an array over all copies for each entry, beside a mask.

The same as Gymnasium's `VectorEnv._add_info` makes of the infos of single environments.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.learning.task import Index

Info = dict[str, Any]


def add(infos: Info, values: Mapping[str, Any], copies: Index, count: int) -> None:
    """Adds values (n, ...) of n of `count` copies to what is there of others."""
    every = isinstance(copies, slice)
    for name, value in values.items():
        there = infos.get(name)
        # the usual case first: it happens for each entry in every step
        if every and there is None and _is_plain(value, count):
            infos[name], infos[f"_{name}"] = value.copy(), _all(count).copy()
            continue
        if isinstance(value, Mapping):
            there = {} if there is None else there
            add(there, value, copies, count)
        else:
            array = _array(value)
            if there is None:
                there = _empty(array, count)
            there[copies] = array
        mask = infos.get(f"_{name}")
        if mask is None:
            mask = np.zeros(count, np.bool_)
        mask[copies] = True
        infos[name], infos[f"_{name}"] = there, mask


def some(values: Mapping[str, Any], rows: NDArray[Any]) -> Info:
    """The values of some copies, by an index or a mask of the n that have values."""
    return {
        name: some(value, rows)
        if isinstance(value, Mapping)
        else _array(value)[rows]
        if np.ndim(value)
        else value
        for name, value in values.items()
    }


def of_one(values: Mapping[str, Any]) -> Info:
    """The info of the only copy."""
    return {
        name: of_one(value) if isinstance(value, Mapping) else _first(_array(value))
        for name, value in values.items()
    }


def _is_plain(value: Any, count: int) -> bool:
    return type(value) is np.ndarray and value.dtype.kind != "U" and value.shape[:1] == (count,)


@cache
def _all(count: int) -> NDArray[np.bool_]:
    return np.ones(count, np.bool_)


def _array(value: Any) -> NDArray[Any]:
    array = np.asarray(value)
    return array.astype(object) if array.dtype.kind == "U" else array


def _empty(like: NDArray[Any], count: int) -> NDArray[Any]:
    shape = count, *like.shape[1:]
    return np.full(shape, None, object) if like.dtype == object else np.zeros(shape, like.dtype)


def _first(array: NDArray[Any]) -> Any:
    value = array[0] if array.ndim else array[()]
    if isinstance(value, np.ndarray):
        return value.copy()
    # Gymnasium makes arrays of objects for np.bool_
    return bool(value) if isinstance(value, np.bool_) else value
