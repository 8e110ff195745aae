"""Observations and event flags that an inline group reads from its newest rows, in C++."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from o80.base.argument_checks import mapping, sequence
from o80.base.errors import InvalidArgument
from o80.base.loop_options import did_you_mean
from o80.rows.columns import Column, columns_at

#: A path of a number, a comparison, and a value (or the label of an enumeration).
Comparison = tuple[str, Literal["==", "!=", "<", "<=", ">", ">="], float | str]


@dataclass(frozen=True)
class Gathered:
    """Numbers of a row for an observation: clip((number - offset) * scale, *clip).

    path: for example "observed", "observed.elbow", "extended.force[2]".
    offset, scale: a number, or one for each number of the path.
    clip: the lowest and the highest value (None: no limits).

    Computed in double precision, then rounded to float32.
    """

    path: str
    offset: ArrayLike = 0.0
    scale: ArrayLike = 1.0
    clip: tuple[float, float] | None = None


#: Place of a number in a row: offset [bytes], and type as NumPy names it.
_Place: TypeAlias = tuple[int, str]
#: Name of a number of an observation; its place, offset, scale, low, high.
_Number: TypeAlias = tuple[str, tuple[_Place, float, float, float, float]]


class Gather:
    """Numbers and flags that `InlineGroup.gather` reads from each copy.

    observations: float32 (copies, numbers).
    flags: bool (copies, flags); `gather["name"]` is one flag of all copies.

    The group overwrites both arrays in every call.
    """

    def __init__(self, copies: int, names: list[str], flag_names: list[str]) -> None:
        self._names, self._flag_names = names, flag_names
        self.observations: NDArray[np.float32] = np.zeros((copies, len(names)), np.float32)
        self.flags: NDArray[np.bool_] = np.zeros((copies, len(flag_names)), np.bool_)

    @property
    def names(self) -> list[str]:
        """Names of the numbers of an observation."""
        return list(self._names)

    @property
    def flag_names(self) -> list[str]:
        """Names of the flags."""
        return list(self._flag_names)

    def __getitem__(self, name: str) -> NDArray[np.bool_]:
        """One flag of all copies: (copies,)."""
        if name not in self.flag_names:
            near = did_you_mean(name, self.flag_names)
            raise KeyError(f"no flag is named '{name}'{near}")
        return self.flags[:, self._flag_names.index(name)]


def numbers_from(wanted: Sequence[str | Gathered], schema: dict[str, Any]) -> list[_Number]:
    """Returns the numbers of an observation. Raises InvalidArgument for an unknown path."""
    found: list[_Number] = []
    for each in sequence(wanted, "numbers", "['observed']"):
        gathered = Gathered(each) if isinstance(each, str) else each
        if not isinstance(gathered, Gathered):
            raise InvalidArgument(f"numbers must be paths or o80.Gathered objects, got {each!r}")
        found += _numbers_of(gathered, schema)
    return found


def _numbers_of(gathered: Gathered, schema: dict[str, Any]) -> Iterator[_Number]:
    columns = columns_at(schema, gathered.path)
    try:
        offsets = np.broadcast_to(np.asarray(gathered.offset, np.float64), len(columns))
        scales = np.broadcast_to(np.asarray(gathered.scale, np.float64), len(columns))
    except ValueError as error:
        raise InvalidArgument(
            f"offset and scale of '{gathered.path}' must be a number or one for each of its "
            f"{len(columns)} numbers: {error}"
        ) from None
    low, high = gathered.clip or (0.0, 0.0)
    if gathered.clip is not None and not low < high:
        raise InvalidArgument(f"clip of '{gathered.path}' must be (low, high), got {gathered.clip}")
    for column, offset, scale in zip(columns, offsets, scales, strict=True):
        yield column.name, (_place(column), float(offset), float(scale), float(low), float(high))


def flags_from(
    wanted: Mapping[str, str | Comparison], schema: dict[str, Any]
) -> dict[str, tuple[_Place, str, float]]:
    """Returns place, comparison and value by flag. Raises InvalidArgument for a wrong one."""
    flags = {}
    for name, given in mapping(wanted, "flags", "names to comparisons").items():
        comparison = (given, "!=", 0) if isinstance(given, str) else given
        if not isinstance(comparison, tuple) or len(comparison) != 3:
            raise InvalidArgument(
                f"flag '{name}' must be a path or (path, comparison, value), got {given!r}"
            )
        path, compare, value = comparison
        columns = columns_at(schema, path)
        if len(columns) != 1:
            raise InvalidArgument(
                f"flag '{name}' must compare one number, and '{path}' has {len(columns)}: "
                f"name one, such as '{columns[0].name}'"
            )
        flags[name] = _place(columns[0]), compare, _value_of(value, columns[0], name)
    return flags


def _value_of(value: Any, column: Column, flag: str) -> float:
    if isinstance(value, str):
        labels = column.labels or {}
        if value not in labels:
            raise InvalidArgument(
                f"flag '{flag}': '{column.name}' has no label '{value}'"
                + (did_you_mean(value, labels) or f", its labels are {', '.join(labels) or 'none'}")
            )
        return float(labels[value])
    return float(value)


def _place(column: Column) -> _Place:
    return column.offset, column.dtype.name
