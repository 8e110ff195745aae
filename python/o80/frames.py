"""Histories as pandas data frames."""

import itertools
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from o80.extras import needed
from o80.layout import dtype_of_field

if TYPE_CHECKING:
    import pandas

    from o80.history import History


class Column(NamedTuple):
    """One number of a row."""

    name: str
    dtype: np.dtype[Any]
    offset: int  #: in the row
    labels: dict[str, int] | None  #: of an enumeration


def frame_of(history: "History") -> "pandas.DataFrame":
    """A row for each observation, a column for each number."""
    pandas = needed("pandas", "pandas", "a data frame")
    rows = history.rows
    data: dict[str, Any] = {
        name: getattr(history, name)
        for name in ("time", "lateness", "overruns", "skipped", "fresh", "halted")
    }
    for column in columns_of(history.schema):
        values = _values(rows, column)
        data[column.name] = (
            values if column.labels is None else _categories(pandas, values, column.labels)
        )
    names = [actuator["name"] for actuator in history.schema["actuators"]]
    for part in ("active", "clamped", "braking"):
        mask = getattr(history, part)
        data.update({f"{part}.{name}": mask[:, i] for i, name in enumerate(names)})
    return pandas.DataFrame(data, index=pandas.Index(history.iteration, name="iteration"))


def columns_of(schema: dict[str, Any]) -> Iterator[Column]:
    """The columns of desired, observed and extended numbers."""
    row = schema["row"]
    for part in ("desired", "observed"):
        counts = [0] * len(schema["groups"])
        for actuator in schema["actuators"]:
            group = schema["groups"][actuator["group"]]
            offset = row[part] + group["offset"]
            offset += counts[actuator["group"]] * group["type"]["size"]
            counts[actuator["group"]] += 1
            yield from _numbers(group["type"], f"{part}.{actuator['name']}", offset)
    if "extended" in schema:
        yield from _numbers(schema["extended"], "extended", row["extended"])


def _numbers(described: dict[str, Any], path: str, start: int) -> Iterator[Column]:
    """The columns of a described type, in order."""
    for field in described["fields"]:
        inner = f"{path}.{field['name']}" if field["name"] else path
        dtype = dtype_of_field(field)
        places = itertools.product(*map(range, field["shape"]))
        for i, place in enumerate(places):
            name = inner + "".join(f"[{k}]" for k in place)
            offset = start + field["offset"] + i * dtype.itemsize
            if field["kind"] == "struct":
                yield from _numbers(field["type"], name, offset)
            else:
                labels = field["labels"] if field["kind"] == "enum" else None
                yield Column(name, dtype, offset, labels)


def _values(rows: NDArray[Any], column: Column) -> NDArray[Any]:
    """The numbers of a column as a contiguous copy: (T,)."""
    if not len(rows):
        return np.empty(0, column.dtype)
    part: NDArray[Any] = np.ndarray(
        (len(rows),), column.dtype, rows, column.offset, (rows.strides[0],)
    )
    return part.copy()


def _categories(pandas: Any, values: NDArray[Any], labels: dict[str, int]) -> Any:
    """Labels of an enumeration as categories; other values become missing values."""
    codes = np.full(len(values), -1)
    for code, value in enumerate(labels.values()):
        codes[values == value] = code
    return pandas.Categorical.from_codes(codes, list(labels))
