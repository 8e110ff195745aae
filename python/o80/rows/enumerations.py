"""Enumerations of a robot: numbers with labels, in rows and in arrays of rows."""

import copyreg
from collections.abc import Iterator, Mapping
from enum import EnumType, IntEnum
from functools import lru_cache
from typing import Any, ClassVar, TypeAlias

import numpy as np
from numpy.typing import NDArray

import o80._core as _core
from o80.base.errors import InvalidArgument


class EnumerationType(EnumType):
    """The type of Enumeration and its subclasses, which are pickled by their labels."""


class Enumeration(IntEnum, metaclass=EnumerationType):
    """A value of an enumerated field: equal to its label and to its number, printed as its label.

    A comparison with a text that is no label raises InvalidArgument, a ValueError. The hash is that
    of the number: sets and dictionaries find a value by number, not by label. A number without a
    label is possible, because a driver may publish any number.
    """

    _labels_: ClassVar[dict[str, int]]
    _texts_: ClassVar[dict[int, str]]

    @classmethod
    def _missing_(cls, value: object) -> "Enumeration | None":
        """Makes the value for a label, or for a number without a label."""
        if isinstance(value, str):
            return cls(number_of(cls, value))
        if not isinstance(value, int):
            return None
        unnamed = int.__new__(cls, value)
        unnamed._name_, unnamed._value_ = str(value), value
        return unnamed

    def __eq__(self, other: object) -> bool:
        if isinstance(other, str):
            return int(self) == number_of(type(self), other)
        return int.__eq__(self, other)

    def __ne__(self, other: object) -> bool:
        if isinstance(other, str):
            return int(self) != number_of(type(self), other)
        return int.__ne__(self, other)

    __hash__ = int.__hash__

    def __str__(self) -> str:
        return self._texts_.get(self._value_, self._name_)

    def __format__(self, spec: str) -> str:
        number = spec[-1:] in tuple("bcdoxXneEfFgG%")
        return int.__format__(self, spec) if number else format(str(self), spec)

    def __reduce_ex__(self, protocol: Any) -> tuple[Any, ...]:
        return type(self), (self._value_,)


#: The enumeration of a plain field; for a struct, the enumerations of its fields by name.
Labels: TypeAlias = type[Enumeration] | Mapping[str, Any]


@lru_cache(maxsize=1024)
def enumeration_of(name: str, labels: tuple[tuple[str, int], ...]) -> type[Enumeration]:
    """Makes the enumeration with these labels and numbers, once."""
    members = {_member_name(label): number for label, number in labels}
    make: Any = Enumeration
    made: type[Enumeration] = make(name, members, module=__name__)
    made._labels_ = dict(labels)
    made._texts_ = {number: label for label, number in reversed(labels)}
    return made


def _member_name(label: str) -> str:
    """Returns the attribute of a label: the label itself, unless Python reserves it."""
    reserved = label in ("", "mro") or (label.startswith("_") and label.endswith("_"))
    return f"{label}_" if reserved else label


def _reduced(enumeration: type[Enumeration]) -> str | tuple[Any, ...]:
    if enumeration is Enumeration:
        return "Enumeration"
    return enumeration_of, (enumeration.__name__, tuple(enumeration._labels_.items()))


copyreg.pickle(EnumerationType, _reduced)  # type: ignore[arg-type]


def number_of(enumeration: type[Enumeration], label: str) -> int:
    """Returns the number of a label. Raises InvalidArgument with the known labels."""
    number = enumeration._labels_.get(label)
    if number is None:
        instead = _core.names_instead(label, list(enumeration._labels_))
        raise InvalidArgument(f"'{enumeration.__name__}' has no label {label!r}{instead}")
    return number


def numbers_of(labels: Labels | None, value: Any) -> Any:
    """Replaces labels in a value by numbers. Raises InvalidArgument for unknown labels."""
    if not isinstance(labels, type):
        return value
    if isinstance(value, str):
        return number_of(labels, value)
    if isinstance(value, np.ndarray) and value.dtype.kind not in "OUT":
        return value
    if isinstance(value, (list, tuple, np.ndarray)):
        given = np.asarray(value, object)  # not as texts: numbers may stand beside labels
        if any(isinstance(each, str) for each in given.flat):
            numbers = [number_of(labels, e) if isinstance(e, str) else e for e in given.flat]
            return np.array(numbers, object).reshape(given.shape)
    return value


def _each(enumeration: type[Enumeration], numbers: Any) -> Any:
    """Converts each number in nested lists to its value."""
    if isinstance(numbers, list):
        return [_each(enumeration, number) for number in numbers]
    return enumeration(numbers)


class EnumerationArray(np.ndarray[Any, np.dtype[Any]]):
    """Values of an enumerated field, or structs with such fields, as an array of numbers.

    `array == "label"` compares each element, and raises InvalidArgument, a ValueError, for a text
    that is no label. An element is an Enumeration. Results of arithmetic are plain numbers.
    """

    _labels: Labels | None

    def __array_finalize__(self, made_from: NDArray[Any] | None) -> None:
        self._labels = getattr(made_from, "_labels", None)

    def labels(self) -> NDArray[Any]:
        """Returns the label of each element as text; the decimal number if there is no label."""
        if not isinstance(self._labels, type):
            raise InvalidArgument("an array of structs has no labels: choose a field of it")
        texts = [str(value) for value in self.ravel().tolist()]
        return np.array(texts, np.str_).reshape(self.shape)

    def tolist(self) -> Any:
        """Returns a list of Enumerations, nested like the array; for structs a list of numbers."""
        numbers = super().tolist()
        return _each(self._labels, numbers) if isinstance(self._labels, type) else numbers

    def __getitem__(self, key: Any) -> Any:
        value = super().__getitem__(key)
        if isinstance(key, str):
            return labelled(value.view(np.ndarray), self._inner(key))
        if isinstance(value, EnumerationArray) or self._labels is None:
            return value
        if isinstance(self._labels, type):
            return self._labels(int(value))
        place = key if isinstance(key, tuple) else (key,)
        return _row_of(super().__getitem__((*place, ...)).view(np.ndarray), self._labels)

    def __setitem__(self, key: Any, value: Any) -> None:
        labels = self._inner(key) if isinstance(key, str) else self._labels
        super().__setitem__(key, numbers_of(labels, value))

    def _inner(self, name: str) -> Labels | None:
        return self._labels.get(name) if isinstance(self._labels, Mapping) else None

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        if ufunc in (np.equal, np.not_equal):
            inputs = tuple(self._comparable(each) for each in inputs)
        plain = (
            np.asarray(each) if isinstance(each, EnumerationArray) else each for each in inputs
        )
        out = options.get("out", ())
        if out:
            options["out"] = tuple(
                each.view(np.ndarray) if isinstance(each, EnumerationArray) else each
                for each in out
            )
        result = getattr(ufunc, method)(*plain, **options)
        return (out[0] if len(out) == 1 else out) if out else result

    def _comparable(self, other: Any) -> Any:
        if not isinstance(self._labels, type) and np.asarray(other).dtype.kind in "UT":
            raise InvalidArgument(
                f"this array no longer knows its labels: compare it with numbers, got {other!r}"
            )
        return numbers_of(self._labels, other)

    def __array_function__(self, function: Any, types: Any, given: Any, named: Any) -> Any:
        if function in (np.isin, np.array_equal):
            given = tuple(numbers_of(self._labels, each) for each in given)
            tested = {name: named[name] for name in named if name in ("test_elements", "a2")}
            named = {**named, **{k: numbers_of(self._labels, v) for k, v in tested.items()}}
        result = super().__array_function__(function, types, given, named)
        if function in (np.concatenate, np.where) and isinstance(result, np.ndarray):
            parts = given[0] if function is np.concatenate else given[1:]
            kinds = [getattr(part, "_labels", None) for part in parts]
            if all(kind is None for kind in kinds):
                return np.asarray(result)
            array = result.view(EnumerationArray)
            array._labels = kinds[0] if all(kind == kinds[0] for kind in kinds) else None
            return array
        return result

    def __reduce__(self) -> Any:
        return labelled, (np.ascontiguousarray(self.view(np.ndarray)), self._labels)

    def __repr__(self) -> str:
        shown = self.labels() if isinstance(self._labels, type) else self.view(np.ndarray)
        return repr(shown)

    def __str__(self) -> str:
        shown = self.labels() if isinstance(self._labels, type) else self.view(np.ndarray)
        return str(shown)


class EnumerationRow(np.void):  # type: ignore[misc]
    """One struct with enumerated fields, an element of an EnumerationArray."""

    _labels: Mapping[str, Any]

    def __getitem__(self, key: Any) -> Any:
        value = super().__getitem__(key)
        name = key if isinstance(key, str) else (self.dtype.names or ())[key]
        labels = self._labels.get(name)
        if labels is None:
            return value
        if isinstance(value, np.ndarray):
            return labelled(value, labels)
        if isinstance(value, np.void):
            return _row_of(np.asarray(value), labels)
        return labels(int(value))

    def __setitem__(self, key: Any, value: Any) -> None:
        name = key if isinstance(key, str) else (self.dtype.names or ())[key]
        super().__setitem__(key, numbers_of(self._labels.get(name), value))

    def __iter__(self) -> Iterator[Any]:
        return (self[name] for name in self.dtype.names or ())

    def __reduce__(self) -> tuple[Any, ...]:
        plain = np.asarray(self)
        return _row_of, (plain.view(np.dtype((np.void, self.dtype))), self._labels)


def labelled(array: NDArray[Any], labels: Labels | None) -> NDArray[Any]:
    """Returns the same array as an EnumerationArray, if it has labels."""
    if not labels:
        return array
    view = array.view(EnumerationArray)
    view._labels = labels
    return view


def _row_of(array: NDArray[Any], labels: Mapping[str, Any]) -> Any:
    """Makes a struct with labels, in the memory of an array ()."""
    row: Any = array.view(np.dtype((EnumerationRow, array.dtype)))[()]
    row._labels = labels
    return row
