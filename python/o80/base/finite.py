"""Writes JSON; reports numbers that are not finite to formats that cannot hold them."""

import json
import math
import warnings
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

Say = Callable[[str], object]
_MOST_NAMED = 5


def warn(text: str) -> None:
    """Gives a RuntimeWarning, at the caller of the function that called `say`."""
    warnings.warn(text, RuntimeWarning, stacklevel=4)


def say_not_finite(found: Mapping[str, int], become: str, say: Say = warn) -> None:
    """Reports how many numbers of which fields are not finite, and what replaces them."""
    counts = {name: count for name, count in found.items() if count}
    if not counts:
        return
    named = [f"{name or 'the value'} ({count})" for name, count in counts.items()]
    more = len(named) - _MOST_NAMED
    text = ", ".join(named[:_MOST_NAMED]) + (f" and {more} more fields" if more > 0 else "")
    total = sum(counts.values())
    numbers = "1 number is" if total == 1 else f"{total} numbers are"
    say(f"{numbers} not finite, {become}: {text}")


def json_text(
    value: Any, *, say: Say = warn, default: Callable[[Any], Any] | None = None, **options: Any
) -> str:
    """Writes strict JSON: non-finite numbers become null, and `say` gets a sentence about them.

    default, options: as in `json.dumps`.
    """
    try:
        return json.dumps(value, allow_nan=False, default=default, **options)
    except ValueError:
        found: Counter[str] = Counter()
        plain = _finite(value, "", found, default)
        say_not_finite(found, "written as null", say)
        return json.dumps(plain, allow_nan=False, default=default, **options)


def _finite(
    value: Any, name: str, found: Counter[str], default: Callable[[Any], Any] | None
) -> Any:
    """Replaces each float that is not finite by None, and counts it by name."""
    if isinstance(value, float):
        if math.isfinite(value):
            return value
        found[name] += 1
        return None
    if isinstance(value, Mapping):
        return {
            str(key) if isinstance(key, float) else key: _finite(
                each, f"{name}.{key}".lstrip("."), found, default
            )
            for key, each in value.items()
        }
    if isinstance(value, list | tuple):
        return [_finite(each, name, found, default) for each in value]
    if default is None or value is None or isinstance(value, str | int):
        return value
    return _finite(default(value), name, found, default)
