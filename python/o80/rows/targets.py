"""Converts targets of trajectories from Python values to bytes of each actuator."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from o80.base.errors import InvalidArgument
from o80.rows.enumerations import numbers_of
from o80.rows.layout import Layout, dtype_of_type, labels_of_type, runs_of


def states_of(
    targets: ArrayLike | Mapping[str, ArrayLike],
    actuators: Sequence[int],
    single: bool,
    layout: Layout,
) -> tuple[NDArray[np.uint8], int, list[int]]:
    """Bytes of all rows of the first actuator, then of the second, and so on; number of rows;
    words with a bit for each number of a state that is given, empty if all are.
    """
    kind = common_type(actuators, layout)
    labels = common_labels(actuators, layout)
    if not isinstance(targets, Mapping) and _are_first_fields(targets, kind):
        assert kind.names is not None
        targets = {kind.names[0]: targets}
    given: Sequence[str] = kind.names or ()
    if isinstance(targets, Mapping):
        array = _from_fields(targets, kind, labels)
        given = list(targets)
    else:
        array = states_from(numbers_of(labels, targets), kind)
    if single and array.ndim == 1:
        array = array[:, np.newaxis]
    if array.ndim != 2 or array.shape[1] != len(actuators):
        expected = "(T,)" if single else f"(T, {len(actuators)})"
        raise InvalidArgument(
            f"the targets of {len(actuators)} actuators are {expected}, not {array.shape}"
        )
    states = np.zeros(array.T.shape, kind)  # a copy would hold anything in its padding
    states[...] = array.T
    return states.reshape(-1).view(np.uint8), len(array), _mask_of(given, kind)


def states_from(targets: ArrayLike, kind: np.dtype[Any]) -> NDArray[Any]:
    """An array of states. Raises InvalidArgument, also for numbers where a state has several.

    NumPy would give each field of a state the same number.
    """
    try:
        array = np.asarray(targets, kind)
    except (TypeError, ValueError) as error:
        raise InvalidArgument(f"the targets cannot be read as {kind}: {error}") from error
    if kind.names is not None and _numbers_in(kind) > 1:
        try:
            given = np.asarray(targets)
        except ValueError:  # of mixed lengths: states in tuples
            return array
        if given.dtype.names is None and given.shape == array.shape:
            raise InvalidArgument(
                f"numbers alone leave fields of these states open ({', '.join(kind.names)}): give "
                f"a mapping from each field to an array, or a structured array"
            )
    return array


def _are_first_fields(targets: ArrayLike, kind: np.dtype[Any]) -> bool:
    """True for numbers, or labels, where a state has several fields: each is the first one."""
    if kind.names is None or _numbers_in(kind) == 1:
        return False
    try:
        array = np.asarray(targets)
    except ValueError:  # of mixed lengths: states in tuples
        return False
    try:
        return array.dtype.names is None and array.shape == np.asarray(targets, kind).shape
    except (TypeError, ValueError):
        return array.dtype.kind == "U"


def _numbers_in(kind: np.dtype[Any]) -> int:
    return sum(count for _, _, count in runs_of(kind, 0))


def _mask_of(given: Sequence[str], kind: np.dtype[Any]) -> list[int]:
    """A bit for each number of a state that is given, in words of 64; empty for all."""
    if set(given) == set(kind.names or ()):
        return []
    assert kind.fields is not None
    bits, place = 0, 0
    for name in kind.names or ():
        count = _numbers_in(kind.fields[name][0])
        if name in given:
            bits |= (1 << count) - 1 << place
        place += count
    return [bits >> word & 2**64 - 1 for word in range(0, place, 64)]


def state_types(actuators: Sequence[int], layout: Layout) -> list[np.dtype[Any]]:
    """The state type of each of these actuators."""
    return [dtype_of_type(_type_of(actuator, layout)) for actuator in actuators]


def common_type(actuators: Sequence[int], layout: Layout) -> np.dtype[Any]:
    """The state type of all these actuators. Raises InvalidArgument if they differ."""
    schema = layout.schema
    groups = {schema["actuators"][actuator]["group"] for actuator in actuators}
    kinds = {dtype_of_type(schema["groups"][group]["type"]) for group in groups}
    if len(kinds) == 1:
        return kinds.pop()
    names = ", ".join(schema["groups"][group]["name"] for group in sorted(groups))
    raise InvalidArgument(
        f"the groups {names} have states of different types: give each a trajectory of its own"
        if groups
        else "a trajectory needs an actuator"
    )


def common_labels(actuators: Sequence[int], layout: Layout) -> Any:
    """The enumerations in the state of actuators that have a common type."""
    return labels_of_type(_type_of(actuators[0], layout))


def _type_of(actuator: int, layout: Layout) -> dict[str, Any]:
    """The described type of an actuator's state."""
    schema = layout.schema
    described: dict[str, Any] = schema["groups"][schema["actuators"][actuator]["group"]]["type"]
    return described


def _from_fields(
    targets: Mapping[str, ArrayLike], kind: np.dtype[Any], labels: Any
) -> NDArray[Any]:
    """One structured array from an array for each field; 0 in fields that are left out."""
    names = kind.names or ()
    if not targets or not set(targets) <= set(names):
        there = ", ".join(names) or "none, it is a plain number"
        raise InvalidArgument(
            f"a trajectory needs fields of the state ({there}), not {', '.join(targets) or 'none'}"
        )
    columns = {
        name: np.asarray(numbers_of(labels.get(name), values)) for name, values in targets.items()
    }
    assert kind.fields is not None
    inner = {name: len(kind.fields[name][0].shape) for name in targets}
    shapes = {column.shape[: column.ndim - inner[name]] for name, column in columns.items()}
    if len(shapes) != 1:
        raise InvalidArgument(f"the fields have different numbers of targets: {sorted(shapes)}")
    array = np.zeros(shapes.pop(), kind)
    for name, column in columns.items():
        array[name] = column
    return array


def times_of(times: ArrayLike) -> NDArray[np.int64]:
    """[s] => [ns]"""
    try:
        seconds = np.asarray(times, np.float64)
    except (TypeError, ValueError):
        raise InvalidArgument(
            f"the times of a trajectory must be finite numbers (T,) [s], got {times!r}"
        ) from None
    if seconds.ndim != 1 or not np.all(np.isfinite(seconds)):
        raise InvalidArgument(
            f"the times of a trajectory must be finite numbers (T,) [s], got {times!r:.60}"
        )
    if seconds.size == 0:
        raise InvalidArgument("the times of a trajectory are empty: give one for each row")
    if np.any(np.abs(seconds) > 1e9):
        raise InvalidArgument("the times of a trajectory are too long to be counted")
    return np.rint(seconds * 1e9).astype(np.int64)
