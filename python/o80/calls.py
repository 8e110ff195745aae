"""Error texts for calls of compiled methods with wrong arguments."""

import difflib
import inspect
from collections.abc import Mapping, Sequence
from typing import Any, NoReturn


def refuse(
    signature: str, this: object, arguments: Sequence[Any], keywords: Mapping[str, Any]
) -> NoReturn:
    """Raises the TypeError of a function with this signature, with a list of its arguments."""
    made: dict[str, Any] = {}
    exec(f"from __future__ import annotations\n{signature}: ...", made)
    function = made[signature.removeprefix("def ").partition("(")[0]]
    takes = inspect.signature(function)
    names = [name for name in takes.parameters if name != "self"]
    text = ""
    try:
        function(this, *arguments, **keywords)
    except TypeError as error:
        text = str(error)
    else:
        text = f"{function.__name__}() cannot be called with {arguments!r} and {keywords!r}"
    near = [
        close
        for word in keywords
        if word not in names
        for close in difflib.get_close_matches(word, names, 1)
    ]
    if near:
        text += f" (did you mean '{near[0]}'?)"
    if len(arguments) > sum(p.kind is not p.KEYWORD_ONLY for p in takes.parameters.values()) - 1:
        text += " (give the rest by name)"
    raise TypeError(f"{text}. It takes {', '.join(names)}")
