"""Writes histories to files of other formats, one column for each number."""

import csv
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.base.errors import InvalidArgument
from o80.base.extras import needed
from o80.base.finite import Say, json_text, say_not_finite, warn
from o80.rows.columns import chosen, columns_of
from o80.rows.history import History, columns_in

Columns = dict[str, NDArray[Any]]
Labels = dict[str, dict[int, str]]


def write(
    path: Path, histories: Mapping[str, History], fields: Sequence[str] = (), say: Say = warn
) -> None:
    """Writes histories, by name, in the format of the path's suffix.

    fields: such as "observed.elbow", "elbow" or "extended" (empty: all); iteration and time are
        always written.

    .npz: arrays `name/column`. .h5, .hdf5: a group per name with a dataset per column. .csv,
    .parquet: one table; only for a single history. In .csv numbers that are not finite are empty
    cells, reported to `say`. Enumerations are numbers; their labels are in an array
    `name/column.labels` of (label, number), in the dataset's HDF5 type, or as JSON in the metadata
    `labels` of Parquet's column. Raises InvalidArgument (format, field), MissingExtra, OSError.
    """
    if path.suffix not in WRITERS:
        known = ", ".join(WRITERS)
        raise InvalidArgument(f"unknown format '{path.suffix}' of {path}: choose one of {known}")
    labels = {name: labels_in(each) for name, each in histories.items()}
    tables = {name: columns_in(each) for name, each in histories.items()}
    if fields:
        for name, columns in tables.items():
            wanted = ["iteration", "time", *chosen(name, list(columns), fields)]
            tables[name] = {column: columns[column] for column in dict.fromkeys(wanted)}
            labels[name] = {key: labels[name][key] for key in wanted if key in labels[name]}
    WRITERS[path.suffix](path, tables, labels)
    if path.suffix == ".csv":
        (columns,) = tables.values()
        say_not_finite({name: _count(each) for name, each in columns.items()}, "left empty", say)


def _count(values: NDArray[Any]) -> int:
    """Counts the numbers that are not finite."""
    return int(np.count_nonzero(~np.isfinite(values))) if values.dtype.kind == "f" else 0


def labels_in(history: History) -> Labels:
    """Returns the labels of columns with enumerations, by number."""
    return {
        column.name: {number: label for label, number in reversed(column.labels.items())}
        for column in columns_of(history.schema)
        if column.labels is not None
    }


def _write_npz(path: Path, histories: Mapping[str, Columns], labels: Mapping[str, Labels]) -> None:
    arrays = {
        f"{name}/{column}": v for name, each in histories.items() for column, v in each.items()
    }
    for name, each in labels.items():
        for column, known in each.items():
            rows = [(label, number) for number, label in known.items()]
            text = f"U{max(map(len, known.values()), default=1) or 1}"
            kind = [("label", text), ("number", histories[name][column].dtype)]
            arrays[f"{name}/{column}.labels"] = np.array(rows, kind)
    np.savez_compressed(path, allow_pickle=False, **arrays)


def _write_hdf5(path: Path, histories: Mapping[str, Columns], labels: Mapping[str, Labels]) -> None:
    h5py = needed("h5py", "export", "a file of HDF5")
    with h5py.File(path, "w") as file:
        for name, columns in histories.items():
            group = file.create_group(name)
            for column, values in columns.items():
                if known := labels[name].get(column):
                    numbers = {label: number for number, label in known.items()}
                    values = values.astype(h5py.enum_dtype(numbers, values.dtype))
                group.create_dataset(column, data=values, compression="gzip", compression_opts=1)


def _write_parquet(
    path: Path, histories: Mapping[str, Columns], labels: Mapping[str, Labels]
) -> None:
    name, columns = _only_table(path, histories)
    arrow = needed("pyarrow", "export", "a file of Parquet")
    parquet = needed("pyarrow.parquet", "export", "a file of Parquet")
    arrays = [arrow.array(values) for values in columns.values()]
    fields = []
    for column, array in zip(columns, arrays, strict=True):
        numbers = {label: number for number, label in labels[name].get(column, {}).items()}
        metadata = {"labels": json_text(numbers)} if numbers else None
        fields.append(arrow.field(column, array.type, metadata=metadata))
    parquet.write_table(arrow.Table.from_arrays(arrays, schema=arrow.schema(fields)), path)


def _write_csv(path: Path, histories: Mapping[str, Columns], _: Mapping[str, Labels]) -> None:
    columns = _only_table(path, histories)[1]
    with path.open("w", newline="", encoding="utf-8") as file:
        lines = csv.writer(file, lineterminator="\n")
        lines.writerow(columns)
        lines.writerows(zip(*map(_cells, columns.values()), strict=True))


def _cells(values: NDArray[Any]) -> list[Any]:
    cells: list[Any] = values.tolist()
    return [each if math.isfinite(each) else None for each in cells] if _count(values) else cells


def _only_table(path: Path, histories: Mapping[str, Columns]) -> tuple[str, Columns]:
    if len(histories) != 1:
        raise InvalidArgument(
            f"a {path.suffix} file holds one table, but there are {len(histories)}: "
            f"{', '.join(histories)}. Choose one with --segment, in Python "
            f"with segment=, or write .npz or .h5"
        )
    return next(iter(histories.items()))


WRITERS: dict[str, Callable[[Path, Mapping[str, Columns], Mapping[str, Labels]], None]] = {
    ".npz": _write_npz,
    ".h5": _write_hdf5,
    ".hdf5": _write_hdf5,
    ".parquet": _write_parquet,
    ".csv": _write_csv,
}
