"""Options of a backend and its loop that every robot has.

src/robot/loop/loop_options.cpp describes them, and nothing else does.
"""

import numbers
import operator
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

import o80._core as _core
from o80.base.errors import InvalidArgument


@dataclass(frozen=True)
class LoopOption:
    """A keyword of `Robot.start`, `Robot.inline` and `Backend`, and a flag of `o80 run`."""

    name: str
    kind: str  #: text, number, integer, boolean, word, octal or list
    allowed: str  #: the allowed values, as the end of "lanes must be "
    otherwise: str  #: the default, in words
    help: str
    of_run: bool
    of_start: bool
    of_inline: bool
    of_backend: bool


@cache
def loop_options() -> dict[str, LoopOption]:
    """Returns all options by name, in the order of the help."""
    return {fields[0]: LoopOption(*fields) for fields in _core.loop_options()}


def names_of(place: Literal["start", "inline", "backend"]) -> list[str]:
    """Returns the names of the options that can be given there."""
    return [option.name for option in loop_options().values() if getattr(option, f"of_{place}")]


def loop_texts(given: Mapping[str, Any], names: Iterable[str]) -> list[tuple[str, str]]:
    """Converts the named options, unless None, False or an empty list, to names and texts.

    given: the arguments of a function. Raises InvalidArgument with the option's name and allowed
    values for a wrong value.
    """
    texts = []
    for name in names:
        option, value = loop_options()[name], given[name]
        is_empty = option.kind == "list" and hasattr(value, "__len__") and len(value) == 0
        is_off = option.kind == "boolean" and value is False
        if value is None or is_off or is_empty:
            continue
        texts.append((name, option_text(name, value, option.kind, option.allowed)))
    _core.check_loop_options(texts)
    return texts


def option_text(name: str, value: Any, kind: str, allowed: str) -> str:
    """Converts an option's value to text for C++. Raises InvalidArgument for a wrong value."""
    if not _is_a(kind, value):
        raise InvalidArgument(f"{name} must be {allowed}, got {value!r}")
    if kind != "octal":
        return text_of(value)
    mode = operator.index(value)
    if not 0o400 <= mode <= 0o777:
        raise InvalidArgument(f"{name} must be {allowed}, got {mode} (octal {mode:o})")
    return f"{mode:o}"


def _is_a(kind: str, value: Any) -> bool:
    truth = isinstance(value, bool) or type(value).__name__ == "bool_"
    if kind == "number":
        return isinstance(value, numbers.Real) and not truth
    if kind in ("integer", "octal"):
        return hasattr(value, "__index__") and not truth
    if kind == "boolean":
        return truth
    if kind == "word":
        return isinstance(value, str)
    if kind == "text":
        return isinstance(value, (str, os.PathLike))
    return not isinstance(value, str) and (isinstance(value, Sequence) or hasattr(value, "tolist"))


def text_of(value: Any) -> str:
    """Converts a value to the text that C++ reads."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (str, os.PathLike)):
        return os.fspath(value)
    if hasattr(value, "tolist"):
        return text_of(value.tolist())
    if isinstance(value, Sequence):
        return ",".join(map(text_of, value))
    return str(value)


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Returns the end of an error about an unknown name: the nearest known name, or nothing."""
    readable = name.encode(errors="replace").decode()  # C++ accepts no half characters
    near = _core.nearest_name(readable, list(known))
    return f". Did you mean '{near}'?" if near else ""
