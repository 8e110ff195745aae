"""Compares numbers of the newest rows with values."""

import operator
import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.base.errors import InvalidArgument
from o80.hybrid.sides import Numbers, Side
from o80.learning.task import EVERY

_COMPARED: dict[str, Callable[[Any, Any], Any]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    ">": operator.gt,
}
_FLAG = re.compile(r"\s*(robot|world)\.(\S+)\s*(<=|>=|==|!=|<|>)\s*(\S+)\s*")


class Flags:
    """Comparisons such as "world.extended.puck_speed < 0.01". InvalidArgument for a wrong text."""

    def __init__(self, texts: Sequence[str], robot: Side, world: Side) -> None:
        if isinstance(texts, str):
            raise InvalidArgument(f"flags must be a list of comparisons, such as ['{texts}']")
        sides = {"robot": robot, "world": world}
        self._flags = [_flag(text, sides) for text in texts]

    def __len__(self) -> int:
        return len(self._flags)

    def raised(self, running: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Returns (copies,): True if a comparison holds in a running world (copies, worlds)."""
        raised = np.zeros(len(running), np.bool_)
        for numbers, compare, value in self._flags:
            found = compare(numbers.read(EVERY)[..., 0], value)
            raised |= found if found.ndim == 1 else (found & running).any(axis=1)
        return raised


def _flag(text: str, sides: dict[str, Side]) -> tuple[Numbers, Callable[[Any, Any], Any], float]:
    parts = _FLAG.fullmatch(text)
    try:
        if parts is None:
            raise ValueError
        side, path, compare, value = parts.groups()
        limit = float(value)
    except ValueError:
        raise InvalidArgument(
            f"flag '{text}' must be like 'world.extended.puck_speed < 0.01': robot or world, a "
            "path in its rows, a comparison, a number"
        ) from None
    numbers = sides[side].numbers([path])
    if len(numbers) != 1:
        raise InvalidArgument(
            f"flag '{text}' must compare one number, and '{path}' has {len(numbers)}: name one, "
            f"such as '{numbers.names[0]}'"
        )
    return numbers, _COMPARED[compare], limit
