"""The numbers of a robot's rows, each with a name: "observed.elbow", "extended.force[2]"."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import o80._core as _core
from o80.base.argument_checks import sequence
from o80.base.errors import InvalidArgument
from o80.base.loop_options import did_you_mean
from o80.rows.layout import HEAD, Layout, dtype_of_field, labels_of_field


class Column(NamedTuple):
    """One number of a row."""

    name: str
    dtype: np.dtype[Any]
    offset: int  #: offset in the row [bytes]
    labels: dict[str, int] | None  #: labels of an enumeration; None: none
    #: source of the value: "robot", "clock" or "world" (docs/drivers/simulators.md)
    origin: str = "robot"
    unit: str = ""
    help: str = ""


def columns_of(schema: Mapping[str, Any]) -> Iterator[Column]:
    """The columns of desired, observed and extended numbers."""
    row = schema["row"]
    for part in ("desired", "observed"):
        counts = [0] * len(schema["groups"])
        for actuator in schema["actuators"]:
            group = schema["groups"][actuator["group"]]
            offset = row[part] + group["offset"]
            offset += counts[actuator["group"]] * group["type"]["size"]
            counts[actuator["group"]] += 1
            yield from numbers_below(group["type"], f"{part}.{actuator['name']}", offset)
    if "extended" in schema:
        yield from numbers_below(schema["extended"], "extended", row["extended"])


def columns_of_part(schema: Mapping[str, Any], part: str) -> list[Column]:
    """The columns of "desired", "observed" or "extended" numbers."""
    return [each for each in columns_of(schema) if each.name.startswith(f"{part}.")]


def numbers_below(
    described: Mapping[str, Any], path: str = "", start: int = 0, outer: str = "robot"
) -> Iterator[Column]:
    """Yields the numbers of a described type, in order. outer: origin of the enclosing field."""
    for field in described["fields"]:
        origin = field.get("origin", outer)
        inner = ".".join(filter(None, (path, field["name"])))
        dtype = dtype_of_field(field)
        places = itertools.product(*map(range, field["shape"]))
        for i, place in enumerate(places):
            name = inner + "".join(f"[{k}]" for k in place)
            offset = start + field["offset"] + i * dtype.itemsize
            if field["kind"] == "struct":
                yield from numbers_below(field["type"], name, offset, origin)
            else:
                labels = labels_of_field(field)._labels_ if field["kind"] == "enum" else None
                yield Column(
                    name, dtype, offset, labels, origin, field["unit"], field.get("help", "")
                )


def columns_at(schema: Mapping[str, Any], path: str) -> list[Column]:
    """Returns the numbers at a path: "observed.elbow", "extended.force[2]", a group, "time".

    Raises InvalidArgument if there is none.
    """
    columns = list(columns_of(schema))
    found = [column for column in columns if is_within(column.name, path)]
    if not found and path[-1:] not in ("", "."):  # a group without a name has no path
        found = [c for c in columns if _group_path(c, schema) == path]
    if not found and path in ("iteration", "time"):
        found = [Column(path, np.dtype(dict(HEAD)[path]), schema["row"][path], None)]
    if not found:
        names = [column.name for column in columns]
        part, _, rest = path.partition(".")
        near = did_you_mean(path, names) or did_you_mean(rest, ["desired", "observed"])
        there = [name for name in names if name.startswith(f"{part}.")] or names
        raise InvalidArgument(
            f"a row has no number '{path}'" + (near or f": it has {', '.join(there[:8])}")
        )
    return found


def _group_path(column: Column, schema: Mapping[str, Any]) -> str:
    """Returns the path of the group of a state: "observed.joints"; empty: no state."""
    part, _, rest = column.name.partition(".")
    for actuator in schema["actuators"] if part != "extended" else ():
        if is_within(rest, actuator["name"]):
            return f"{part}.{schema['groups'][actuator['group']]['name']}"
    return ""


class Packing(NamedTuple):
    """Numbers that are copied out of rows, side by side."""

    dtype: np.dtype[np.void]  #: of the numbers of a row
    parts: NDArray[np.uint64]  #: (n, 3): place in a row, size, place among the numbers [bytes]
    numbers: list[list[tuple[np.dtype[Any], int]]]  #: kind and offset of each number, by path

    def arrays(self, rows: NDArray[np.void]) -> tuple[NDArray[Any], ...]:
        """Returns the numbers of each path: (T,) of one number, (T, n) of several."""
        return tuple(self._array(rows, numbers) for numbers in self.numbers)

    @staticmethod
    def _array(rows: NDArray[np.void], numbers: list[tuple[np.dtype[Any], int]]) -> NDArray[Any]:
        kind, offset = numbers[0]
        if len(numbers) == 1:
            return rows.getfield(kind, offset)
        if all(each == kind for each, _ in numbers):
            return rows.getfield(np.dtype((kind, (len(numbers),))), offset)
        return np.stack([rows.getfield(*number) for number in numbers], axis=1)


def packing_of(columns_by_path: Sequence[Sequence[Column]]) -> Packing:
    """Packs the numbers of each path one after another, each aligned."""
    parts: list[list[int]] = []
    numbers: list[list[tuple[np.dtype[Any], int]]] = []
    end, largest = 0, 1
    for columns in columns_by_path:
        numbers.append([])
        for column in columns:
            size = column.dtype.itemsize
            place = -(-end // size) * size
            numbers[-1].append((column.dtype, place))
            if parts and (sum(parts[-1][:2]), sum(parts[-1][1:])) == (column.offset, place):
                parts[-1][1] += size
            else:
                parts.append([column.offset, size, place])
            end, largest = place + size, max(largest, size)
    packed = -(-end // largest) * largest
    return Packing(np.dtype((np.void, packed)), np.array(parts, np.uint64), numbers)


def packing_at(layout: Layout, fields: str | Sequence[str], *more: str) -> Packing:
    """Returns the packing of a history's fields and of more paths. Raises InvalidArgument."""
    paths = [fields] if isinstance(fields, str) else sequence(fields, "fields", "['observed']")
    columns = [layout.columns_at(path, columns_at) for path in (*paths, *more)]
    packing: Packing | None = layout.packings.get(key := (*paths, *more))
    if packing is None:
        packing = layout.packings[key] = packing_of(columns)
    return packing


def value_of(row: Any, column: Column) -> Any:
    """Returns the number of a column in an observation."""
    return np.ndarray((), column.dtype, row, column.offset)[()]


def labelled_value_of(row: Any, column: Column) -> Any:
    """Returns the number of a column in an observation, or the label if it has one."""
    value = value_of(row, column).item()
    labels = column.labels or {}
    return next((label for label, number in labels.items() if number == value), value)


def numbers_in(row: Any, layout: Layout, path: str) -> Any:
    """Returns numbers of an observation: one, or (n,). InvalidArgument for an unknown path."""
    values = [value_of(row, column) for column in layout.columns_at(path, columns_at)]
    return values[0] if len(values) == 1 else np.array(values)


def is_within(column: str, path: str) -> bool:
    """True if a path names a column, or a field that contains it."""
    return column == path or column.startswith((path + ".", path + "["))


def is_part(column: str, field: str) -> bool:
    """True if a field such as "observed.elbow", "elbow" or "extended" is or contains a column."""
    return is_within(column, field) or is_within(column.partition(".")[2], field)


def chosen(robot: str, columns: Sequence[str], fields: Sequence[str]) -> list[str]:
    """Returns the columns in some field. Raises InvalidArgument for a field without columns."""
    for field in fields:
        if not any(is_part(column, field) for column in columns):
            outer = {column.partition("[")[0] for column in columns}
            short = {name.partition(".")[2] or name for name in outer}
            known = [*sorted(short), *sorted(outer - short)]
            raise InvalidArgument(
                f"'{robot}' has no field '{field}'{_core.names_instead(field, known)}"
            )
    return [column for column in columns if any(is_part(column, field) for field in fields)]
