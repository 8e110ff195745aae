"""Signatures of compiled methods, and error texts for calls with wrong arguments."""

import inspect
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import o80._core as _core


@cache
def _declared(signature: str) -> Any:
    """A function of this signature without a body."""
    made: dict[str, Any] = {}
    exec(f"from __future__ import annotations\n{signature}: ...", made)
    return made[signature.removeprefix("def ").partition("(")[0]]


class _Annotation(str):
    """The text of an annotation, printed without quotation marks."""

    __repr__ = str.__str__


def signature_of(signature: str) -> inspect.Signature:
    """The result of `inspect.signature` for a method with this signature."""
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
    signature: str, this: object, arguments: Sequence[Any], keywords: Mapping[str, Any]
) -> None:
    """Raises the TypeError of a function with this signature, with a list of its arguments.

    Returns if the arguments fit.
    """
    function = _declared(signature)
    takes = signature_of(signature)
    names = [name for name in takes.parameters if name != "self"]
    try:
        function(this, *arguments, **keywords)
        return
    except TypeError as error:
        text = str(error)
    unknown = next((word for word in keywords if word not in names), "")
    if near := _core.nearest_name(unknown, names):
        text += f" (did you mean '{near}'?)"
    by_place = sum(p.kind is not p.KEYWORD_ONLY for p in takes.parameters.values()) - 1
    if names and len(arguments) > by_place:
        text += " (give the rest by name)"
    raise TypeError(f"{text}. It takes {', '.join(names)}" if names else text)
