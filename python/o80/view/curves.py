"""Curves of rows with as many points as a page can show."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80._core import Observation
from o80.rows.columns import Column, columns_of, labelled_value_of
from o80.rows.history import History, values_of
from o80.rows.plans import Planned
from o80.view.base64_arrays import packed

STRETCHES = 400  # stretches of a curve, about one for each pixel of its width
MAX_PANELS = 12
MAX_PLANS = 30  # newest plans of chunks in a panel
EXACT = 2**53  # integers below are exact in a browser
FIRST_PANELS = 3  # shown before the user chooses


class Panels:
    """The possible panels of a robot: columns of each panel, by part of the row."""

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
        #: the panels that are shown before the user chooses: one for each actuator
        self.first = [panel for panel in of_actuators if panel] or self.names[:FIRST_PANELS]

    @property
    def names(self) -> list[str]:
        """All panels."""
        return list(self.columns)

    def curves(
        self, rows: History, panels: list[str], begin: int
    ) -> dict[str, dict[str, list[str]]]:
        """Returns seconds from `begin` [ns] and values of rows in order, by panel and part.

        The rows draw the whole curve: first, lowest, highest and last row of each stretch.
        """
        found: dict[str, dict[str, list[str]]] = {}
        if not len(rows):
            return found
        seconds = (rows.time - begin) * 1e-9
        for panel in panels[:MAX_PANELS]:
            found |= {panel: {}} if panel in self.columns else {}
            for part, column in self.columns.get(panel, {}).items():
                values = values_of(rows, column).astype(np.float64)
                drawn = drawn_rows(values)
                found[panel][part] = [packed(seconds[drawn]), packed(values[drawn])]
        return found

    def add_plans(
        self,
        drawn: dict[str, dict[str, list[str]]],
        plans: Mapping[str, Sequence[Planned]],
        rows: History,
        begin: int,
    ) -> int:
        """Adds the planned positions of chunks to the curves of `rows`, a gap before each plan, and
        returns the time [ns] at which the last plan ends.
        """
        last = 0
        for panel, of in plans.items():
            if panel not in drawn or len(rows) < 2:
                continue
            period = float(rows.time[-1] - rows.time[0]) / float(
                rows.iteration[-1] - rows.iteration[0]
            )
            seconds: list[NDArray[np.float64]] = []
            values: list[NDArray[np.float64]] = []
            for begins, places, _ in of[-MAX_PLANS:]:
                kept = drawn_rows(places)
                times = rows.time[-1] + (begins + kept - rows.iteration[-1]) * period
                last = max(last, int(times[-1]))
                seconds += [(times - begin) * 1e-9, times[-1:] * 0.0]
                values += [places[kept], np.array([np.nan])]
            drawn[panel]["planned"] = [
                packed(np.concatenate(seconds)),
                packed(np.concatenate(values)),
            ]
        return last

    @property
    def units(self) -> dict[str, str]:
        """The unit of each panel that has one."""
        units = {panel: next(iter(of.values())).unit for panel, of in self.columns.items()}
        return {panel: unit for panel, unit in units.items() if unit}

    @property
    def labels(self) -> dict[str, dict[int, str]]:
        """Labels by number, for each panel of an enumeration."""
        labels = {panel: next(iter(of.values())).labels for panel, of in self.columns.items()}
        return {
            panel: {number: label for label, number in of.items()}
            for panel, of in labels.items()
            if of is not None
        }

    def values(self, row: Observation, panels: list[str]) -> dict[str, dict[str, float | str]]:
        """Returns a row's numbers by panel and part; numbers that JSON cannot hold are texts."""
        return {
            panel: {
                part: _shown(labelled_value_of(row, column), column)
                for part, column in self.columns[panel].items()
            }
            for panel in panels[:MAX_PANELS]
            if panel in self.columns
        }


def drawn_rows(values: NDArray[np.float64]) -> NDArray[np.intp]:
    """Returns indices of the rows that draw a curve: (n,), rising; NaN in a stretch included."""
    step = -(-len(values) // STRETCHES)
    if step <= 4:
        return np.arange(len(values))
    starts = np.arange(0, len(values), step)
    ends = np.minimum(starts + step, len(values)) - 1
    grid = np.pad(values, (0, len(starts) * step - len(values)), "edge").reshape(-1, step)
    extremes = [starts + grid.argmin(axis=1), starts + grid.argmax(axis=1)]
    return np.unique(np.concatenate([starts, *extremes, ends]))


def _shown(value: Any, column: Column) -> float | str:
    is_text = column.labels is not None or not math.isfinite(value) or abs(value) >= EXACT
    return str(value) if is_text else value
