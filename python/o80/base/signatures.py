"""Signatures of compiled methods, and error texts for calls with wrong arguments."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from functools import cache, wraps
from typing import Any, TypeVar, cast

import o80._core as _core

_Function = TypeVar("_Function", bound=Callable[..., Any])
_Class = TypeVar("_Class")


@cache
def _declared(signature: str) -> Any:
    """Makes a function of this signature without a body."""
    made: dict[str, Any] = {}
    exec(f"from __future__ import annotations\n{signature}: ...", made)
    return made[signature.removeprefix("def ").partition("(")[0]]


class _Annotation(str):
    """The text of an annotation, printed without quotation marks."""

    __repr__ = str.__str__


def signature_of(signature: str) -> inspect.Signature:
    """Returns the result of `inspect.signature` for a method with this signature."""
    plain = inspect.signature(_declared(signature))
    return plain.replace(
        parameters=[
            each
            if each.annotation is each.empty
            else each.replace(annotation=_Annotation(each.annotation))
            for each in plain.parameters.values()
        ],
        return_annotation=_Annotation(plain.return_annotation),
    )


def refuse(
    signature: str,
    this: object,
    arguments: Sequence[Any],
    keywords: Mapping[str, Any],
    refused: BaseException,
) -> None:
    """Raises the TypeError of a function with this signature, with a list of its arguments.

    refused: the error of nanobind, or an error of a method that has acted, with what it has done.
    Returns if the arguments fit.
    """
    function = _declared(signature)
    try:
        function(this, *arguments, **keywords)
        return
    except TypeError as error:
        text = str(error)
    done = str(refused)
    raise _refusal(
        text if "incompatible function arguments" in done else f"{done}{text}",
        signature_of(signature),
        arguments,
        keywords,
    )


def explained(function: _Function) -> _Function:
    """Makes a method of Python report wrong arguments like a compiled method."""

    @wraps(function)
    def verb(*arguments: Any, **keywords: Any) -> Any:
        try:
            return function(*arguments, **keywords)
        except TypeError as error:
            trace = error.__traceback__
            if trace is None or trace.tb_next is not None:  # raised inside the function
                raise
            text = str(error).replace(function.__qualname__, function.__name__)
        raise _refusal(text, inspect.signature(function), arguments[1:], keywords)

    return cast(_Function, verb)


def explains(cls: type[_Class]) -> type[_Class]:
    """Makes each public method of a class an `explained` one."""
    for name, method in list(vars(cls).items()):
        if inspect.isfunction(method) and not name.startswith("_"):
            setattr(cls, name, explained(method))
    return cls


def _refusal(
    text: str, takes: inspect.Signature, arguments: Sequence[Any], keywords: Mapping[str, Any]
) -> TypeError:
    names = [name for name in takes.parameters if name != "self"]
    unknown = next((word for word in keywords if word not in names), "")
    if near := _core.nearest_name(unknown, names):
        text += f" (did you mean '{near}'?)"
    by_place = sum(p.kind is not p.KEYWORD_ONLY for p in takes.parameters.values()) - 1
    if names and len(arguments) > by_place:
        text += " (give the rest by name)"
    return TypeError(f"{text}. It takes {', '.join(names)}" if names else text)
