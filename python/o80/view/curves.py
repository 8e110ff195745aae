"""Curves of rows with as many points as a page can show: the extremes of each stretch."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80._core import Observation
from o80.rows.columns import Column, columns_of, value_of
from o80.rows.history import History, values_of
from o80.view.base64_arrays import packed

POINTS = 400  # of a curve
MAX_PANELS = 12
FIRST_PANELS = 3  # shown before the user chooses


class Panels:
    """Panels that can be drawn of a robot: for each its columns, by part of the row."""

    def __init__(self, schema: dict[str, Any]) -> None:
        self.columns: dict[str, dict[str, Column]] = {}
        for column in columns_of(schema):
            part, _, rest = column.name.partition(".")
            panel = column.name if part == "extended" else rest
            self.columns.setdefault(panel, {})[part] = column
        actuators = [actuator["name"] for actuator in schema["actuators"]][:FIRST_PANELS]
        of_actuators = (
            next((panel for panel in self.columns if panel.split(".")[0].split("[")[0] == name), "")
            for name in actuators
        )
        self._first = [panel for panel in of_actuators if panel] or self.names[:FIRST_PANELS]

    @property
    def names(self) -> list[str]:
        """All panels."""
        return list(self.columns)

    @property
    def first(self) -> list[str]:
        """The panels that are shown before the user chooses: one for each actuator."""
        return self._first

    def curves(
        self, rows: History, panels: list[str], begin: int
    ) -> dict[str, dict[str, list[str]]]:
        """By panel and part: seconds from `begin` [ns], lowest and highest values.

        The highest are left out where they are the lowest.
        """
        found: dict[str, dict[str, list[str]]] = {}
        starts = _stretches(len(rows))
        if not len(starts):
            return found
        seconds = packed((rows.time[starts] - begin) * 1e-9)
        for panel in panels[:MAX_PANELS]:
            columns = self.columns.get(panel)
            if columns is None:
                continue
            found[panel] = {
                part: [seconds, *_extremes(values_of(rows, column), starts)]
                for part, column in columns.items()
            }
        return found

    def values(self, row: Observation, panels: list[str]) -> dict[str, dict[str, str]]:
        """The numbers of one row as text, by panel and part."""
        return {
            panel: {
                part: _text(value_of(row, column), column)
                for part, column in self.columns[panel].items()
            }
            for panel in panels[:MAX_PANELS]
            if panel in self.columns
        }


def _stretches(rows: int) -> NDArray[np.intp]:
    """Where each stretch of rows begins."""
    step = max(1, -(-rows // POINTS))
    return np.arange(0, rows, step)


def _extremes(values: NDArray[Any], starts: NDArray[np.intp]) -> list[str]:
    numbers = values.astype(np.float64)
    if len(starts) == len(numbers):
        return [packed(numbers)]
    # NaN in a stretch makes a gap in the curve
    return [
        packed(np.minimum.reduceat(numbers, starts)),
        packed(np.maximum.reduceat(numbers, starts)),
    ]


def _text(value: Any, column: Column) -> str:
    if column.labels is not None:
        labels = {number: label for label, number in column.labels.items()}
        return labels.get(int(value), str(int(value)))
    if column.dtype.kind == "f":
        return f"{float(value):.4g}"
    return str(value.item())
