"""Converts a robot's rows to NumPy arrays."""

from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache, partialmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray

import o80._core as _core
from o80.base.cached import cached
from o80.base.errors import InvalidArgument
from o80.rows.enumerations import Enumeration, enumeration_of, labelled
from o80.rows.record import Fields, Record, States

HEAD = (
    ("iteration", "i8"),
    ("time", "i8"),
    ("lateness", "i8"),
    ("overruns", "u4"),
    ("skipped", "u4"),
    ("fresh", "u4"),
    ("halted", "u4"),
    ("starvations", "i8"),
)
MASKS = ("active", "clamped", "braking", "starved")  #: parts of a row with a bit for each actuator


def dtype_of_field(field: dict[str, Any]) -> np.dtype[Any]:
    """Returns the dtype of one element of a described field."""
    kind = field["kind"]
    if kind == "struct":
        return dtype_of_type(field["type"])
    if kind == "enum":
        kind = f"{'i' if field['signed'] else 'u'}{field['size']}"
    dtype: np.dtype[Any] = np.dtype(kind)
    return dtype


def is_plain(described: dict[str, Any]) -> bool:
    """True if a described type is a plain number."""
    fields = described["fields"]
    return len(fields) == 1 and not fields[0]["name"]


def dtype_of_type(described: dict[str, Any]) -> np.dtype[Any]:
    """Returns the dtype of a described struct or plain number."""
    fields = described["fields"]
    if is_plain(described):
        return np.dtype((dtype_of_field(fields[0]), tuple(fields[0]["shape"])))
    return np.dtype(
        {
            "names": [field["name"] for field in fields],
            "formats": [(dtype_of_field(field), tuple(field["shape"])) for field in fields],
            "offsets": [field["offset"] for field in fields],
            "itemsize": described["size"],
        }
    )


def labels_of_type(described: dict[str, Any]) -> Any:
    """Returns the enumeration of a plain field; for a struct those of its fields, by name."""
    if is_plain(described):
        return labels_of_field(described["fields"][0], described["name"])
    found = {field["name"]: labels_of_field(field) for field in described["fields"]}
    return {name: labels for name, labels in found.items() if labels}


def labels_of_field(field: dict[str, Any], otherwise: str = "") -> Any:
    """Returns the labels of a field, empty or None without. otherwise: name if it has none."""
    if field["kind"] == "struct":
        return labels_of_type(field["type"])
    if field["kind"] != "enum":
        return None
    bits, is_signed = 8 * field["size"], field["signed"]
    wrapped = 1 << bits
    labels = []
    for label, number in field["labels"].items():
        value = number % wrapped  # an unsigned number is described as a signed one of 64 bits
        labels.append((label, value - wrapped if is_signed and value >> (bits - 1) else value))
    return enumeration_of(field["name"] or otherwise or "state", tuple(labels))


def request_fields(described: dict[str, Any], buffer: Any) -> Fields:
    """Makes the fields of a request in the memory of a buffer."""
    return Fields(np.ndarray((), dtype_of_type(described), buffer), labels_of_type(described))


def dtype_of_block(groups: list[dict[str, Any]], size: int) -> np.dtype[Any]:
    """Returns the dtype of all states of a robot."""
    formats = [
        (dtype_of_type(group["type"]), (group["count"],) if group["array"] else ())
        for group in groups
    ]
    if len(groups) == 1 and not groups[0]["name"]:
        return np.dtype(formats[0])
    return np.dtype(
        {
            "names": [group["name"] for group in groups],
            "formats": formats,
            "offsets": [group["offset"] for group in groups],
            "itemsize": size,
        }
    )


def fields_of(described: dict[str, Any]) -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
    """Yields every field of a described type, also nested ones, with its struct."""
    for field in described["fields"]:
        yield described, field
        if field["kind"] == "struct":
            yield from fields_of(field["type"])


def runs_of(dtype: np.dtype[Any], offset: int) -> Iterator[tuple[np.dtype[Any], int, int]]:
    """Yields the numbers of a dtype in order: (kind, offset, count)."""
    if dtype.subdtype is not None:
        element, shape = dtype.subdtype
        count = int(np.prod(shape))
        if element.names is None:
            yield element, offset, count
            return
        for i in range(count):
            yield from runs_of(element, offset + i * element.itemsize)
    elif dtype.names is None:
        yield dtype, offset, 1
    else:
        assert dtype.fields is not None
        for name in dtype.names:
            member = dtype.fields[name]
            yield from runs_of(member[0], offset + member[1])


def count_of(dtype: np.dtype[Any]) -> int:
    """Returns how many numbers a dtype holds."""
    return sum(count for _, _, count in runs_of(dtype, 0))


def joined(
    runs: Iterator[tuple[np.dtype[Any], int, int]],
) -> list[tuple[np.dtype[Any], int, int]]:
    """Joins adjacent runs of one kind."""
    result: list[tuple[np.dtype[Any], int, int]] = []
    for kind, offset, count in runs:
        if result:
            last, begin, length = result[-1]
            if last == kind and begin + length * last.itemsize == offset:
                result[-1] = (kind, begin, length + count)
                continue
        result.append((kind, offset, count))
    return result


def field_view(rows: NDArray[Any], *paths: str) -> NDArray[Any]:
    """Returns a view (..., n) of a field's numbers in rows (...): "extended.joint_positions".

    paths: path of one field, or of several adjacent fields.

    Raises InvalidArgument if a field is missing, or if their numbers do not make one array.
    """
    runs = joined(run for path in paths for run in runs_of(*field_at(rows.dtype, path)))
    if len(runs) != 1:
        raise InvalidArgument(f"{', '.join(paths)}: must be of one type, side by side in a row")
    kind, offset, count = runs[0]
    return rows.getfield(np.dtype((kind, (count,))), offset)


def field_at(
    dtype: np.dtype[Any], path: str, what: str = "path in a row"
) -> tuple[np.dtype[Any], int]:
    """Returns dtype and offset [bytes] of a field, named by a path with dots.

    Raises InvalidArgument if there is no such field; its text calls the path `what`.
    """
    offset = 0
    for name in path.split("."):
        fields: Mapping[str, Any] = dtype.fields or {}
        if name not in fields:
            known = ", ".join([*fields][:5]) or "no fields"
            raise InvalidArgument(f"there is no {what} '{path}': '{name}' is none of {known}")
        dtype, begin = fields[name][:2]
        offset += begin
    return dtype, offset


def with_padding(rows: NDArray[Any]) -> NDArray[Any]:
    """Returns a view of rows as items without fields, whose copies include the padding of the rows.

    NumPy copies rows field by field, which leaves out the padding or leaves it undefined.
    """
    return rows.view(np.dtype((np.void, rows.itemsize)))


class Layout:
    """Reads the rows of one robot."""

    def __init__(self, description: _core.Description) -> None:
        schema = description.schema()
        row = schema["row"]
        self.schema: dict[str, Any] = schema
        self._description = description
        self.size: int = row["size"]
        self.actuators = len(schema["actuators"])
        self.states = dtype_of_block(schema["groups"], row["observed"] - row["desired"])
        self.extras = dtype_of_type(schema["extended"]) if "extended" in schema else np.dtype([])
        self._at: dict[str, int] = row
        self._mask_bytes: int = row["mask_words"] * 8
        self._is_array = self.states.subdtype is not None
        self._element, self._shape = self.states.subdtype or (self.states, ())
        groups = {group["name"]: labels_of_type(group["type"]) for group in schema["groups"]}
        #: enumerations of states, by group
        self.labels = {name: labels for name, labels in groups.items() if labels}
        #: enumerations of sensor values, by field
        self.extended_labels = labels_of_type(schema["extended"]) if "extended" in schema else {}
        self._is_plain_array = self._is_array and not self.labels
        self._columns: dict[str, list[Any]] = {}
        self.packings: dict[tuple[str, ...], Any] = {}  #: of the paths of a history, for Reader

    def columns_at(self, path: str, find: Callable[[dict[str, Any], str], list[Any]]) -> list[Any]:
        """Returns the columns at a path; caches the results of `o80.rows.columns.columns_at`."""
        if not isinstance(path, str):
            raise InvalidArgument(f"a path of numbers must be a text, got {path!r}")
        found = self._columns.get(path)
        if found is None:
            found = self._columns[path] = find(self.schema, path)
        return found

    @cached
    def row(self) -> np.dtype[Any]:
        """The dtype of a whole row; masks as bytes, a bit for each actuator."""
        parts = [(name, np.dtype(kind), self.schema["row"][name]) for name, kind in HEAD]
        if self.actuators:
            mask = np.dtype(("u1", (self._mask_bytes,)))
            off_plan = np.dtype(("f4", (self.actuators,)))
            kinds = {"desired": self.states, "observed": self.states, "off_plan": off_plan}
            kinds |= dict.fromkeys(MASKS, mask)
            parts += [(name, kind, self._at[name]) for name, kind in kinds.items()]
        if self.extras.itemsize:
            parts.append(("extended", self.extras, self._at["extended"]))
        # NumPy saves only fields that are in the order of their offsets
        parts.sort(key=lambda part: part[2])
        names, formats, offsets = zip(*parts, strict=True)
        return np.dtype(
            {"names": names, "formats": formats, "offsets": offsets, "itemsize": self.size}
        )

    @cached
    def runs(self) -> list[tuple[np.dtype[Any], int, int]]:
        """All numbers of observed, then of extended: (kind, offset in the row, count)."""
        return joined(
            run
            for dtype, offset in (
                (self.states, self._at["observed"]),
                (self.extras, self._at["extended"]),
            )
            for run in runs_of(dtype, offset)
        )

    @cached
    def enums(self) -> dict[str, type[Enumeration]]:
        """Enumerations of all enumerated fields: by field name, and by "Type.field".

        If a state is a plain enum, its enum is named after the group, or "state".
        """
        found: dict[str, type[Enumeration]] = {}
        ambiguous: set[str] = set()
        types = [(group["type"], group["name"]) for group in self.schema["groups"]]
        types += [(request["type"], request["name"]) for request in self.schema["requests"]]
        if "extended" in self.schema:
            types.append((self.schema["extended"], "extended"))
        for described, place in types:
            for owner, field in fields_of(described):
                if field["kind"] != "enum":
                    continue
                name = field["name"] or owner["name"] or place or "state"
                values = labels_of_field(field, owner["name"])
                found[f"{owner['name']}.{name}" if field["name"] else name] = values
                if name in found and found[name]._labels_ != values._labels_:
                    ambiguous.add(name)
                found.setdefault(name, values)
        return {name: values for name, values in found.items() if name not in ambiguous}

    def of_states(self, states: NDArray[Any]) -> Any:
        """Returns states as an array, or as a record of groups, with their labels."""
        if self._is_plain_array:
            return states
        return labelled(states, self.labels[""]) if self._is_array else Record(states, self.labels)

    def states_in(self, buffer: Any, offset: int = 0) -> NDArray[Any]:
        """Returns a view of the states of all actuators in a buffer."""
        return np.ndarray(self._shape, self._element, buffer, offset)

    def labelled_states(self, buffer: Any) -> NDArray[Any]:
        """Returns the states in a buffer as an array to write, which accepts labels."""
        labels = self.labels.get("") if self._is_array else self.labels
        return labelled(self.states_in(buffer), labels)

    def labelled_extras(self, buffer: Any) -> NDArray[Any]:
        """Returns the sensor values in a buffer as an array to write, which accepts labels."""
        return labelled(np.ndarray((), self.extras, buffer), self.extended_labels)

    # one row, as a buffer => arrays over its memory

    def _states(self, part: str, row: Any) -> Any:
        return self.of_states(self.states_in(row, self._at[part]))

    desired = partialmethod(_states, "desired")
    observed = partialmethod(_states, "observed")

    def way_to(self, part: str) -> Any:
        """Shape, dtype and offset of a part that is a plain array; else the method for it."""
        if part == "off_plan":
            return (self.actuators,), np.dtype(np.float32), self._at[part]
        if part in ("desired", "observed") and self._is_plain_array:
            return self._shape, self._element, self._at[part]
        return getattr(self, part)

    def extended(self, row: Any) -> Record:
        return Record(np.ndarray((), self.extras, row, self._at["extended"]), self.extended_labels)

    def mask_in(self, buffer: Any, offset: int = 0) -> NDArray[np.bool_]:
        """Reads a mask (actuators,) from a buffer with one bit for each actuator."""
        bits = np.ndarray((self._mask_bytes,), np.uint8, buffer, offset)
        return np.unpackbits(bits, count=self.actuators, bitorder="little").view(np.bool_)

    def _mask(self, part: str, row: Any) -> NDArray[np.bool_]:
        return self.mask_in(row, self._at[part])

    active = partialmethod(_mask, "active")
    clamped = partialmethod(_mask, "clamped")
    braking = partialmethod(_mask, "braking")
    starved = partialmethod(_mask, "starved")

    def flat(self, row: Any, dtype: Any = None) -> NDArray[Any]:
        kind = np.dtype(np.float32 if dtype is None else dtype)
        parts = [np.ndarray((count,), own, row, offset) for own, offset, count in self.runs]
        if len(parts) == 1:
            return parts[0].astype(kind)
        if not parts:
            return np.empty(0, kind)
        return np.concatenate(parts, dtype=kind, casting="unsafe")

    def text(self, row: Any) -> str:
        lines = [f"<o80.Observation of iteration {row.iteration} at {row.time * 1e-9:.6f} s"]
        if self.actuators:
            lines += [f"  desired:  {row.desired}", f"  observed: {row.observed}"]
        if self.extras.names:
            lines.append(f"  extended: {row.extended}")
        return "\n".join(lines) + ">"

    # many rows, as an array of `row` => views with a first dimension

    def check(self, rows: NDArray[Any]) -> None:
        """Raises InvalidArgument if rows have another layout than described."""
        if rows.dtype is self.row or rows.dtype == self.row:
            return
        raise InvalidArgument(
            f"rows of {rows.dtype.itemsize} bytes do not have the layout of "
            f"'{self.schema['robot']}' ({self.size} bytes). NumPy's concatenate and where drop "
            f"padding: give them single fields, such as history.observed"
        )

    def many(self, rows: NDArray[Any], part: str) -> States:
        """Returns the states of an array of rows: (T, actuators), or a record of groups."""
        nothing: Any = Record(np.empty(len(rows), np.dtype([])))
        states: States = self.of_states(rows[part]) if self.actuators else nothing
        return states

    def many_extras(self, rows: NDArray[Any]) -> Record:
        """Returns the extended values of an array of rows."""
        if not self.extras.itemsize:
            return Record(np.empty(len(rows), np.dtype([])))
        return Record(rows["extended"], self.extended_labels)

    @property
    def model(self) -> str:
        """The model (MJCF) that draws the robot; empty: none."""
        return self._description.model()

    def many_masks(self, rows: NDArray[Any], part: str) -> NDArray[np.bool_]:
        """Reads a mask of an array of rows: bool (T, actuators)."""
        if not self.actuators:
            return np.zeros((len(rows), 0), np.bool_)
        bits = np.ascontiguousarray(rows[part])
        unpacked = np.unpackbits(bits, axis=-1, count=self.actuators, bitorder="little")
        return unpacked.view(np.bool_)

    def many_flat(self, rows: NDArray[Any], dtype: Any = None) -> NDArray[Any]:
        """Returns all observed numbers, then all extended ones: (T, numbers)."""
        kind = np.dtype(np.float32 if dtype is None else dtype)
        columns = sum(count for _, _, count in self.runs)
        result = np.empty((len(rows), columns), kind)
        column = 0
        for own, offset, count in self.runs:
            part = rows.getfield(np.dtype((own, (count,))), offset)
            result[:, column : column + count] = part
            column += count
        return result


@lru_cache(maxsize=64)
def decoder_of(table: bytes, epoch: int = 0) -> _core.Decoder:
    """Makes the decoder of pickled or recorded rows.

    table: the description in the format of a segment. epoch: number of the publishing run.
    """
    description = _core.Description(table, epoch)
    return _core.Decoder(description, Layout(description))
