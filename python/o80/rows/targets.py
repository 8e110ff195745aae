"""Converts targets of trajectories from Python values to bytes of each actuator."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

import o80._core as _core
from o80.base.errors import InvalidArgument
from o80.rows.enumerations import numbers_of
from o80.rows.layout import Layout, count_of, dtype_of_type, labels_of_type

#: Rows of targets: an array, or a mapping from fields, groups, actuators or paths to arrays.
Rows: TypeAlias = "ArrayLike | Mapping[str, Any]"


def states_of(
    targets: Rows, actuators: Sequence[int], layout: Layout
) -> tuple[NDArray[np.uint8], int, list[int]]:
    """Returns bytes of all rows of the first actuator, then of the second, and so on; number of
    rows; words with a bit for each number of a state that is given, actuator by actuator, or no
    words if all numbers are given.
    """
    parts = _Parts(actuators, state_types(actuators, layout), layout)
    if isinstance(targets, Mapping):
        for key, values in targets.items():
            parts.add(key, values)
    else:
        parts.fill(list(range(len(actuators))), None, targets)
    return parts.states()


class _Parts:
    """Columns of rows for each of several actuators, by their fields."""

    def __init__(
        self, actuators: Sequence[int], kinds: list[np.dtype[Any]], layout: Layout
    ) -> None:
        self._kinds = kinds
        self._types = [_type_of(each, layout) for each in actuators]
        schema = layout.schema
        rows = [schema["actuators"][each] for each in actuators]
        self._names = [each["name"] for each in rows]
        self._groups = [schema["groups"][each["group"]]["name"] for each in rows]
        # for each actuator: values (T, ...) by field; a whole state by ""
        self._columns: list[dict[str, NDArray[Any]]] = [{} for _ in actuators]

    def add(self, key: str, values: Any) -> None:
        """Adds targets by the name of an actuator, a group or a field, or by a path."""
        name, _, field = key.partition(".")
        places = self._named(key) or (self._named(name) if field else [])
        inner: str | None = None if self._named(key) else field or None
        if not places:
            inner = key
            places = [i for i, kind in enumerate(self._kinds) if key in (kind.names or ())]
        if not places:
            known = {*self._names, *self._groups, *(n for k in self._kinds for n in k.names or ())}
            instead = _core.names_instead(key, sorted(known - {""}))
            raise InvalidArgument(f"no actuator, group or field is named {key!r}{instead}")
        if isinstance(values, Mapping):
            for each, column in values.items():
                self.fill(places, each, column)
        else:
            self.fill(places, inner, values)

    def _named(self, name: str) -> list[int]:
        names = self._names if name in self._names else self._groups
        return [i for i, each in enumerate(names) if each == name and name]

    def fill(self, places: list[int], field: str | None, values: Any) -> None:
        """Sets a field of these actuators (None: the first field) from (T, actuators), or (T,)."""
        if field is None and len({self._kinds[place] for place in places}) == 1:
            kind, labels = self._kinds[places[0]], labels_of_type(self._types[places[0]])
            if count_of(kind) > 1:
                with suppress(InvalidArgument):  # states in tuples; else numbers of the first field
                    values = states_from(numbers_of(labels, values), kind)
        array = np.asarray(values)
        if array.dtype.kind in "OUT":  # not as texts: numbers may stand beside labels
            array = np.asarray(values, object)
        whole = array.dtype.names is not None and field is None
        for i, place in enumerate(places):
            kind = self._kinds[place]
            names = kind.names or ()
            if field not in (None, *names):
                raise InvalidArgument(
                    f"the state of '{self._names[place]}' has no field {field!r}"
                    f"{_core.names_instead(str(field), list(names))}"
                )
            named = "" if whole or not names else field or names[0]
            target = kind if not named else _field_of(kind, named)
            axes = 1 + len(target.shape)
            column = array
            if array.ndim == axes + 1 and array.shape[1] == len(places):
                column = array[:, i]
            elif array.ndim != axes or len(places) > 1:
                raise InvalidArgument(
                    f"the targets of {len(places)} actuators must have the shape "
                    f"(T, {len(places)}), got {array.shape}"
                )
            labels = labels_of_type(self._types[place])
            known = labels.get(named) if isinstance(labels, Mapping) else labels
            self._columns[place][named] = _cast(numbers_of(known, column), target)

    def states(self) -> tuple[NDArray[np.uint8], int, list[int]]:
        """Returns the results of states_of()."""
        left_out = [n for n, each in zip(self._names, self._columns, strict=True) if not each]
        if left_out:
            raise InvalidArgument(
                f"the targets lack {', '.join(map(repr, left_out))}: add these, or choose only the "
                "other actuators"
            )
        counts = {len(column) for each in self._columns for column in each.values()}
        if len(counts) != 1:
            raise InvalidArgument(f"the targets have different numbers of rows: {sorted(counts)}")
        (count,) = counts
        whole = np.zeros(count * sum(kind.itemsize for kind in self._kinds), np.uint8)
        masks: list[list[int]] = []
        end = 0
        for kind, columns in zip(self._kinds, self._columns, strict=True):
            begin, end = end, end + count * kind.itemsize
            states = whole[begin:end].view(kind)
            for name, column in columns.items():
                (states[name] if name else states)[...] = column
            masks.append(_mask_of([*columns] if "" not in columns else kind.names or (), kind))
        return whole, count, _words_of(masks, self._kinds)


def _field_of(kind: np.dtype[Any], name: str) -> np.dtype[Any]:
    assert kind.fields is not None
    return kind.fields[name][0]


def _cast(column: Any, kind: np.dtype[Any]) -> NDArray[Any]:
    """Converts numbers to the type of a field; rounds them for an integer or a truth value."""
    base = kind.base
    try:
        array = np.asarray(column)
        if base.kind in "iu" and array.dtype.kind == "f":
            array, numbers = np.rint(array), np.iinfo(base)
            if not np.all((array >= numbers.min) & (array <= numbers.max)):
                raise OverflowError(f"they must be from {numbers.min} to {numbers.max}")
        if base.kind == "b" and array.dtype.kind == "f":
            if not np.isfinite(array).all():
                raise ValueError("one is not a finite number")
            array = array >= 0.5
        return array.astype(base, copy=False)
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidArgument(f"the targets cannot be read as {base}: {error}") from error


def states_from(targets: ArrayLike, kind: np.dtype[Any]) -> NDArray[Any]:
    """Makes an array of states. Raises InvalidArgument, also for numbers of states with fields.

    NumPy would set each field of a state to the same number.
    """
    try:
        array = np.asarray(targets, kind)
    except (TypeError, ValueError) as error:
        raise InvalidArgument(f"the targets cannot be read as {kind}: {error}") from error
    if kind.names is not None and count_of(kind) > 1:
        try:
            given = np.asarray(targets)
        except ValueError:  # of mixed lengths: states in tuples
            return array
        if given.dtype.names is None and given.shape == array.shape:
            raise InvalidArgument(
                f"these states have several fields ({', '.join(kind.names)}): give a mapping from "
                f"each field to an array, or a structured array"
            )
    return array


def _mask_of(given: Sequence[str], kind: np.dtype[Any]) -> list[int]:
    """Returns a bit for each given number of a state, in words of 64; empty: all are given."""
    if set(given) == set(kind.names or ()):
        return []
    assert kind.fields is not None
    bits, place = 0, 0
    for name in kind.names or ():
        count = count_of(kind.fields[name][0])
        if name in given:
            bits |= (1 << count) - 1 << place
        place += count
    return _words(bits, place)


def _words(bits: int, count: int) -> list[int]:
    return [bits >> word & 2**64 - 1 for word in range(0, count, 64)]


def _words_of(masks: list[list[int]], kinds: list[np.dtype[Any]]) -> list[int]:
    """Joins the words of all states; no words if all numbers are given."""
    if not any(masks):
        return []
    numbers = [count_of(kind) for kind in kinds]
    words = (mask or _words((1 << n) - 1, n) for mask, n in zip(masks, numbers, strict=True))
    return [word for each in words for word in each]


def state_types(actuators: Sequence[int], layout: Layout) -> list[np.dtype[Any]]:
    """Returns the state type of each actuator. Raises InvalidArgument if there are none."""
    if not actuators:
        raise InvalidArgument("targets need an actuator")
    return [dtype_of_type(_type_of(actuator, layout)) for actuator in actuators]


def first_fields(actuators: Sequence[int], layout: Layout) -> list[int]:
    """Returns the mask, in the form of `states_of`, that selects the first field of each state."""
    kinds = state_types(actuators, layout)
    masks = [_mask_of(kind.names[:1], kind) if kind.names else [] for kind in kinds]
    return _words_of(masks, kinds)


def labels_of(actuator: int, layout: Layout) -> Any:
    """Returns the enumerations in the state of an actuator."""
    return labels_of_type(_type_of(actuator, layout))


def _type_of(actuator: int, layout: Layout) -> dict[str, Any]:
    schema = layout.schema
    described: dict[str, Any] = schema["groups"][schema["actuators"][actuator]["group"]]["type"]
    return described


def times_of(times: ArrayLike) -> NDArray[np.int64]:
    """Converts times [s] to [ns]. Raises InvalidArgument for others than finite times (T,)."""
    try:
        seconds = np.asarray(times, np.float64)
        if seconds.ndim != 1 or not np.all(np.isfinite(seconds)):
            raise ValueError
    except (TypeError, ValueError):
        raise InvalidArgument(
            f"the times of a trajectory must be finite numbers (T,) [s], got {times!r:.60}"
        ) from None
    if seconds.size == 0:
        raise InvalidArgument("the times of a trajectory are empty: give one for each row")
    if np.any(np.abs(seconds) > 1e9):
        raise InvalidArgument("the times of a trajectory are too long to be counted")
    return np.rint(seconds * 1e9).astype(np.int64)
