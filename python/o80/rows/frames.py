"""Histories as pandas data frames."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from o80.base.extras import needed
from o80.rows.columns import columns_of, values_of

if TYPE_CHECKING:
    import pandas

    from o80.rows.history import History


def frame_of(history: "History") -> "pandas.DataFrame":
    """A row for each observation, a column for each number."""
    pandas = needed("pandas", "pandas", "a data frame")
    data: dict[str, Any] = {
        name: getattr(history, name)
        for name in ("time", "lateness", "overruns", "skipped", "fresh", "halted")
    }
    for column in columns_of(history.schema):
        values = values_of(history, column)
        data[column.name] = (
            values if column.labels is None else _categories(pandas, values, column.labels)
        )
    names = [actuator["name"] for actuator in history.schema["actuators"]]
    for part in ("active", "clamped", "braking"):
        mask = getattr(history, part)
        data.update({f"{part}.{name}": mask[:, i] for i, name in enumerate(names)})
    return pandas.DataFrame(data, index=pandas.Index(history.iteration, name="iteration"))


def _categories(pandas: Any, values: NDArray[Any], labels: dict[str, int]) -> Any:
    """Labels of an enumeration as categories; other values become missing values."""
    codes = np.full(len(values), -1)
    for code, value in enumerate(labels.values()):
        codes[values == value] = code
    return pandas.Categorical.from_codes(codes, list(labels))
