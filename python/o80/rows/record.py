"""Named values, read as attributes or by key, and the type of a robot's states."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

import o80._core as _core
from o80.rows.enumerations import labelled


class Record:
    """Described values of one row, or of many: a view into a structured array.

    `record.force` and `record["force"]` are the same array: (T, ...) for T rows, and without the
    first dimension (a number for a single value) for one row.
    """

    __slots__ = ("_array", "_labels")

    def __init__(self, array: NDArray[Any], labels: Mapping[str, Any] | None = None) -> None:
        """labels: the enumerations, by field; by field and field in nested structs."""
        self._array = array
        self._labels = labels or {}

    def __getitem__(self, name: str) -> "States":
        try:
            value: Any = self._array[name]
        except (KeyError, ValueError, IndexError):
            instead = _core.names_instead(str(name), list(self.keys()))
            raise KeyError(f"there is no value {name!r}{instead}") from None
        labels = self._labels.get(name) if self._labels else None
        if value.dtype.names and value.ndim == self._array.ndim:
            value = type(self)(value, labels)
        elif labels is None:
            value = value if value.ndim else value[()]
        else:
            value = labelled(value, labels) if value.ndim else labels(value.item())
        states: States = value
        return states

    def __getattr__(self, name: str) -> "States":
        if name.startswith("__"):
            raise AttributeError(name)
        try:
            return self[name]
        except KeyError as error:
            raise AttributeError(error.args[0]) from None

    def keys(self) -> tuple[str, ...]:
        """The names of the values."""
        return self._array.dtype.names or ()

    def _ipython_key_completions_(self) -> tuple[str, ...]:
        """Names that IPython and Jupyter complete in `record["`."""
        return self.keys()

    def __iter__(self) -> Iterator[str]:
        return iter(self.keys())

    def __len__(self) -> int:
        return len(self.keys())

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self.keys()]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self._array, dtype=dtype, copy=copy)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Record) and bool(np.array_equal(self._array, other._array))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self._array, self._labels)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"Record({', '.join(f'{name}={self[name]}' for name in self)})"


class Fields(Record):
    """The fields of a request; their numbers are Python's, which any library accepts."""

    __slots__ = ()

    def __getitem__(self, name: str) -> Any:
        value: Any = super().__getitem__(name)
        return value.item() if isinstance(value, np.generic) else value


if TYPE_CHECKING:

    class States(np.ndarray[Any, np.dtype[Any]]):
        """The states of all actuators, of one row or of T rows.

        For a robot with one group of actuators: a NumPy array, (actuators,) or (T, actuators), with
        the dtype of the state: float64, or structured, with `states["position"]` for a field. For a
        robot with several groups: an o80.Record, with `states.joints` or `states["joints"]` for a
        group.

        A type checker accepts both uses, because the robot is known only at run time; there
        `isinstance(states, o80.Record)` distinguishes them.
        """

        def __getattr__(self, name: str) -> "States": ...
        def keys(self) -> tuple[str, ...]:
            """The names of the groups."""
            ...

else:
    States: TypeAlias = np.ndarray | Record
