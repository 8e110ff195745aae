"""Values of an object that are computed once."""

from collections.abc import Callable
from typing import Any, Generic, Self, TypeVar, overload

T = TypeVar("T")


class cached(Generic[T]):  # noqa: N801, used as a decorator
    """`functools.cached_property` without the lock that it has in Python 3.11.

    That is one lock for all objects of a class: if another thread computes a value during a fork,
    the child would wait for it for ever. Without the lock two threads may both compute a value.
    """

    def __init__(self, compute: Callable[[Any], T]) -> None:
        self._compute = compute
        self.__doc__ = compute.__doc__

    def __set_name__(self, owner: type[Any], name: str) -> None:
        self._name = name

    @overload
    def __get__(self, of: None, owner: type[Any]) -> Self: ...
    @overload
    def __get__(self, of: object, owner: type[Any]) -> T: ...
    def __get__(self, of: object | None, owner: type[Any]) -> T | Self:
        if of is None:
            return self
        value: T = of.__dict__.setdefault(self._name, self._compute(of))
        return value
